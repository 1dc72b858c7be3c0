"""The library in a real browser: look, sort, choose, edit, take back; and the bags that result."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from browser import ask_unasked, browser_path, open_page
from msrd_ros.bags.info import read_info
from msrd_ros.recordings.table import rows
from quick_rewards import shipped_bag
from stack import Stack
from studio_stack import start_page, wait_for_page

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]

LABELS = ("backhand-slice", "forehand-push", "forehand-topspin")


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    for label in LABELS:
        for number in (1, 2):
            bag = shipped_bag(1, label, number)
            shutil.copytree(bag, folder / "subject_01" / bag.name)
    return folder


@pytest.fixture(scope="module")
def page(shared_stack: Stack, bags: Path) -> Iterator[Page]:
    browser_path()
    studio = start_page(shared_stack, bags=str(bags))
    with open_page(wait_for_page(shared_stack, studio)) as one:
        one.get_by_role("tab", name="Strokes").click()
        expect(one.locator("#bags tbody tr")).to_have_count(6)
        yield one


def line(page: Page, bag: str) -> Locator:
    return page.locator(f'#bags tbody tr[data-bag="subject_01/{bag}"]')


def said(page: Page, text: str) -> None:
    expect(page.locator("#said")).to_contain_text(text)


def test_studio_library_shows_what_the_command_lists(page: Page, bags: Path) -> None:
    for row in rows(bags):
        cells = line(page, row.bag.removeprefix("subject_01/")).locator("td")
        assert row.spin_rad_s is not None
        assert row.landing_m is not None
        expect(cells.nth(2)).to_have_text(row.label)
        expect(cells.nth(4)).to_have_text(f"{round(row.spin_rad_s[1])}")
        expect(cells.nth(5)).to_have_text(f"{row.landing_m[0]:.2f}")
        expect(cells.nth(6)).to_have_text("✓")
        expect(cells.nth(1).locator("polyline")).to_have_count(1)


def test_studio_library_filters_and_sorts(page: Page, bags: Path) -> None:
    page.get_by_label("Filter strokes").fill("slice")
    expect(page.locator("#bags tbody tr")).to_have_count(2)
    page.get_by_label("Filter strokes").fill("")
    page.locator("#bags th", has_text="spin").click()
    spins = [int(text) for text in page.locator("#bags tbody tr td:nth-child(5)").all_inner_texts()]
    assert spins == sorted(spins)
    page.locator("#bags th", has_text="spin").click()


def test_studio_library_lays_strokes_over_each_other(page: Page) -> None:
    line(page, "forehand-push_001").click()
    line(page, "forehand-topspin_001").click(modifiers=["Control"])
    page.get_by_role("button", name="Lay over each other").click()
    said(page, "2 strokes laid over each other")
    for bag in ("forehand-push_001", "forehand-topspin_001"):
        expect(line(page, bag).locator('.mark[title="laid over the others in this colour"]')).to_be_visible()


def test_studio_library_relabels_and_takes_back(page: Page, bags: Path) -> None:
    before = (bags / "subject_01" / "forehand-push_002" / "metadata.yaml").read_bytes()
    page.once("dialog", lambda dialog: dialog.accept("my-smash"))
    line(page, "forehand-push_002").click()
    page.get_by_role("button", name="Relabel").click()
    expect(line(page, "my-smash_001")).to_be_visible()
    assert read_info(bags / "subject_01" / "my-smash_001").label == "my-smash"
    line(page, "my-smash_001").click()
    page.get_by_role("button", name="Take back").click()
    expect(line(page, "forehand-push_002")).to_be_visible()
    assert (bags / "subject_01" / "forehand-push_002" / "metadata.yaml").read_bytes() == before
    assert not (bags / "subject_01" / "my-smash_001").exists()


def test_studio_library_takes_a_label_away_and_finds_and_shows_the_stroke(page: Page, bags: Path) -> None:
    page.once("dialog", lambda dialog: dialog.accept("unlabelled"))
    line(page, "forehand-push_002").click()
    page.get_by_role("button", name="Relabel").click()
    page.get_by_label("Filter strokes").fill("unlabelled")
    expect(page.locator("#bags tbody tr")).to_have_count(1)
    bare = line(page, "unlabelled_001")
    expect(bare.locator("td").nth(2)).to_have_text("unlabelled")
    expect(bare.locator("td").nth(2)).to_have_attribute("title", re.compile("^forehand, little spin"))
    bare.click()
    page.get_by_role("button", name="Take back").click()
    page.get_by_label("Filter strokes").fill("")
    expect(line(page, "forehand-push_002")).to_be_visible()
    assert not (bags / "subject_01" / "unlabelled_001").exists()


def test_studio_library_throws_away_and_shows_what_was(page: Page, bags: Path) -> None:
    line(page, "backhand-slice_001").click()
    page.get_by_role("button", name="Throw away").click()
    expect(page.locator("#bags tbody tr")).to_have_count(5)
    assert not (bags / "subject_01" / "backhand-slice_001").exists()
    page.get_by_label("discarded, too").check()
    gone = page.locator("#bags tbody tr.discarded")
    expect(gone).to_have_count(1)
    gone.click()
    page.get_by_role("button", name="Take back").click()
    expect(line(page, "backhand-slice_001")).to_be_visible()
    assert (bags / "subject_01" / "backhand-slice_001").is_dir()
    page.get_by_label("discarded, too").uncheck()


def test_studio_library_flags_and_trims(page: Page, bags: Path) -> None:
    page.once("dialog", lambda dialog: dialog.accept("look again"))
    line(page, "backhand-slice_002").click()
    page.get_by_role("button", name="Flag").click()
    expect(line(page, "backhand-slice_002").locator('.mark[title="look again"]')).to_be_visible()
    length_s = read_info(bags / "subject_01" / "backhand-slice_002").duration_ns / 1e9
    page.once("dialog", lambda dialog: dialog.accept("0.1 9"))
    page.get_by_role("button", name="Trim").click()
    said(page, "trim subject_01/backhand-slice_002")
    assert read_info(bags / "subject_01" / "backhand-slice_002").duration_ns / 1e9 < length_s - 0.05
    page.once("dialog", lambda dialog: dialog.accept("1.5 2"))
    page.get_by_role("button", name="Trim").click()
    said(page, "it would be no stroke")


def test_studio_library_refuses_what_is_not_in_its_folder(page: Page) -> None:
    page.evaluate("document.getElementById('discard').disabled = false")
    answer = ask_unasked(page, do="discard", bag="../../etc")
    assert answer["ok"] is False
    assert "no bag '../../etc'" in str(answer["text"])
