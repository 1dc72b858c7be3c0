"""Watching in a real browser: the scene, the words beside it, time, and recorded strokes."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from browser import PATIENCE_S, browser_path, open_page
from msrd_ros.core.resources import shipped_bags
from scene_pictures import share_of_blue, share_of_red, shown
from stack import START_TIMEOUT_S, Stack
from studio_stack import start_studio

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]

SEEN_S = 15.0


@pytest.fixture(scope="module")
def page(shared_stack: Stack) -> Iterator[Page]:
    browser_path()
    address = start_studio(shared_stack, bags=str(shipped_bags()))
    with open_page(address) as one:
        expect(one.locator("#phase")).to_contain_text("waits", timeout=1000 * START_TIMEOUT_S)
        yield one


def test_studio_watch_draws_table_and_arm(page: Page) -> None:
    deadline_s = time.monotonic() + SEEN_S
    while (share := share_of_blue(shown(page))) < 0.01 and time.monotonic() < deadline_s:
        page.wait_for_timeout(200)
    assert share > 0.01
    assert share_of_red(shown(page)) > 0.003


def test_studio_watch_tells_strategy_verdict_and_rates(page: Page) -> None:
    page.get_by_role("button", name="forehand-push", exact=True).click()
    expect(page.locator("#strategy")).to_have_text("forehand-push")
    before = shown(page)
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#phase")).to_have_text("plays")
    page.wait_for_timeout(600)
    assert (np.abs(shown(page) - before).sum(axis=2) > 60).mean() > 0.001
    expect(page.locator("#verdict")).to_contain_text("returned at")
    row = page.locator("#rates tbody tr").filter(has_text="forehand-push")
    expect(row).to_contain_text("100 %")
    page.get_by_role("button", name="count anew").click()
    expect(page.locator("#no-rates")).to_be_visible()


def test_studio_watch_shows_who_is_there_and_what_they_wait_for(page: Page) -> None:
    page.get_by_role("tab", name="Nodes").click()
    for name in ("/simulator", "/executor", "/studio"):
        expect(page.locator(".account").filter(has=page.get_by_text(name, exact=True))).to_be_visible()
    page.get_by_role("tab", name="Play").click()
    page.get_by_role("button", name="none", exact=True).click()
    page.get_by_role("tab", name="Nodes").click()
    expect(page.locator(".account.waits").filter(has_text="/executor")).to_contain_text("a strategy")
    page.get_by_role("tab", name="Play").click()


def clock_s(page: Page) -> float:
    return float(page.locator("#clock").inner_text().split()[0])


def test_studio_watch_pauses_steps_and_slows_down(page: Page) -> None:
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_role("button", name="Go on")).to_be_visible()
    page.wait_for_timeout(300)
    stood_s = clock_s(page)
    page.wait_for_timeout(500)
    assert clock_s(page) == stood_s
    page.get_by_role("button", name="Step").click()
    expect(page.locator("#clock")).to_have_text(f"{stood_s + 0.02:.2f} s")
    page.get_by_role("button", name="Go on").click()
    expect(page.locator("#pause")).to_have_text("Pause")
    page.locator("#rate").focus()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")  # 0.1
    expect(page.locator("#rate-shown")).to_have_text("0.1 ×")
    begun_s, begun = time.monotonic(), clock_s(page)
    page.wait_for_timeout(3000)
    rate = (clock_s(page) - begun) / (time.monotonic() - begun_s)
    assert 0.05 < rate < 0.15
    page.locator("#rate").focus()
    page.keyboard.press("End")
    expect(page.locator("#rate-shown")).to_have_text("as fast as it goes")


def test_studio_watch_scrubs_through_a_recorded_stroke(page: Page) -> None:
    page.get_by_role("tab", name="Strokes").click()
    rows = page.locator("#bags tbody tr")
    expect(rows).not_to_have_count(0)
    page.get_by_label("Filter strokes").fill("backhand-topspin")
    expect(rows.first).to_contain_text("backhand-topspin")
    rows.first.click()
    expect(page.locator("#scrub")).to_be_visible()
    expect(page.locator("#strategy")).to_have_text("backhand-topspin")
    drawn = []
    for place in ("0.1", "0.9"):
        page.locator("#scrubber").fill(place)
        expect(page.locator("#scrub-shown")).to_contain_text(f"{float(place):.2f} of")
        page.wait_for_timeout(700)
        drawn.append(shown(page))
    assert (np.abs(drawn[1] - drawn[0]).sum(axis=2) > 60).mean() > 0.002
    page.get_by_role("button", name="Back to live").click()
    expect(page.locator("#scrub")).to_be_hidden()
    page.get_by_role("tab", name="Play").click()


def test_studio_watch_shows_the_same_to_several_browsers(page: Page) -> None:
    assert page.context.browser is not None
    other = page.context.browser.new_page(viewport={"width": 800, "height": 600})
    other.set_default_timeout(1000 * PATIENCE_S)
    other.goto(page.url)
    page.get_by_role("button", name="backhand-slice", exact=True).click()
    expect(other.locator("#strategy")).to_have_text("backhand-slice")
    other.get_by_role("button", name="forehand-slice", exact=True).click()
    expect(page.locator("#strategy")).to_have_text("forehand-slice")
    other.close()
