"""What rewards say of strokes, in a real browser: curves, bars, the picture and its export."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from browser import browser_path, open_page
from msrd_ros.explain.explanation import explain, load_rewards
from quick_rewards import shipped_bag, shipped_strokes, write_checkpoint
from sawyer import ROBOT
from stack import Stack
from studio_stack import start_page, wait_for_page

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_checkpoint(folder / "checkpoint.safetensors", shipped_strokes(1))
    return folder


@pytest.fixture(scope="module")
def page(shared_stack: Stack, run: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    browser_path()
    bags = tmp_path_factory.mktemp("library")
    for label in ("forehand-push", "forehand-slice"):
        shutil.copytree(shipped_bag(2, label), bags / f"{label}_001")
    studio = start_page(shared_stack, bags=str(bags), run=str(run))
    with open_page(wait_for_page(shared_stack, studio)) as one:
        one.get_by_role("tab", name="Strokes").click()
        expect(one.locator("#bags tbody tr")).to_have_count(2)
        yield one


def test_studio_understand_tells_whose_stroke_it_is(page: Page, run: Path) -> None:
    page.locator('#bags tbody tr[data-bag="forehand-slice_001"]').click()
    page.get_by_role("button", name="Whose is it?").click()
    expect(page.locator("#told")).to_be_visible(timeout=60_000)
    told = explain(load_rewards(run, ROBOT), shipped_strokes(2)[1])
    expect(page.locator("#told-title")).to_have_text(told.title)
    expect(page.locator("#curves polyline")).to_have_count(len(told.labels))
    shares = page.locator("#bars span:nth-child(3n)").all_inner_texts()
    np.testing.assert_allclose([int(text.split()[0]) for text in shares], 100 * told.posterior(), atol=0.51)
    # The stroke can be scrubbed through; the curves' mark goes along.
    page.locator("#scrubber").fill("0.5")
    expect(page.locator("#scrub-shown")).to_contain_text("0.50 of")
    assert float(page.locator("#now").get_attribute("x1") or 0.0) == pytest.approx(560 * 0.5 / 1.9, rel=0.05)


def test_studio_understand_lays_two_beside_each_other_and_exports(page: Page, tmp_path: Path) -> None:
    page.locator('#bags tbody tr[data-bag="forehand-slice_001"]').click()
    page.locator('#bags tbody tr[data-bag="forehand-push_001"]').click(modifiers=["Control"])
    page.get_by_role("button", name="Whose is it?").click()
    expect(page.locator("#picture svg")).to_have_count(1)
    page.wait_for_function("document.getElementById('picture').textContent.includes('forehand-push of')")
    with page.expect_download() as saving:
        page.get_by_text("save as SVG").click()
    saving.value.save_as(tmp_path / "strokes.svg")
    text = "".join(ElementTree.parse(tmp_path / "strokes.svg").getroot().itertext())
    assert "forehand-slice of subject_02" in text
    assert "forehand-push of subject_02" in text


def test_studio_understand_says_when_there_are_no_rewards(page: Page, run: Path) -> None:
    (run / "checkpoint.safetensors").rename(run / "elsewhere.safetensors")
    try:
        page.locator('#bags tbody tr[data-bag="forehand-push_001"]').click()
        page.get_by_role("button", name="Whose is it?").click()
        expect(page.locator("#said.bad")).to_contain_text("no rewards to ask")
    finally:
        (run / "elsewhere.safetensors").rename(run / "checkpoint.safetensors")
