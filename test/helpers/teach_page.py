"""Working the Teach tab as a person does."""

from __future__ import annotations

import math
import time

from playwright.sync_api import Page, expect

from browser import PATIENCE_S

_CENTRE = """selector => {
    const found = document.querySelector(selector);
    if (!found) return null;
    const box = found.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
}"""
SKETCH_S = 240.0
"""The first sketch compiles its search."""
LED_S = 120.0


def begin_sketch(page: Page, name: str) -> None:
    """Give a stroke a name, and wait for what is foretold of it."""
    page.get_by_role("tab", name="Teach").click()
    page.locator("#teach-name").fill(name)
    page.evaluate("document.getElementById('said').textContent = ''")
    page.get_by_role("button", name="Begin").click()
    expect(page.locator("#said")).to_contain_text(f"{name}: a stroke to begin with", timeout=1000 * SKETCH_S)
    expect(page.locator("#teach-foretold")).to_contain_text("Foretold: returned")


def open_another(page: Page, name: str) -> Page:
    """A second browser at the same studio, at Teach; without the scene, which is drawn in software here."""
    assert page.context.browser is not None
    other = page.context.browser.new_page()
    other.route("**/scene/**", lambda route: route.abort())
    other.set_default_timeout(1000 * PATIENCE_S)
    other.goto(page.url)
    other.get_by_role("tab", name="Teach").click()
    other.locator("#teach-name").fill(name)
    return other


def drag_ghost(page: Page, moment: str, right_px: float, up_px: float) -> None:
    """Drag a ghost in the view from the side."""
    place = centre(page, f"#teach-side-view g[data-moment={moment}] .grip")
    assert place is not None
    x, y = place
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right_px / 2, y - up_px / 2, steps=4)
    page.mouse.move(x + right_px, y - up_px, steps=4)
    page.mouse.up()


def turn_ghost(page: Page, moment: str, angle_rad: float) -> None:
    """Turn a ghost in the view from the side, anticlockwise; small angles only."""
    ghost = f"#teach-side-view g[data-moment={moment}]"
    place, handle = centre(page, f"{ghost} .grip"), centre(page, f"{ghost} .turn")
    assert place is not None
    assert handle is not None
    (u, v), (x, y) = place, handle
    page.mouse.move(x, y)
    page.mouse.down()
    # The page's y goes down.
    cos, sin = math.cos(angle_rad), math.sin(-angle_rad)
    page.mouse.move(u + cos * (x - u) - sin * (y - v), v + sin * (x - u) + cos * (y - v), steps=4)
    page.mouse.up()


def centre(page: Page, selector: str) -> tuple[float, float] | None:
    """Where something of the drawing is now, in pixels of the page; None while it is not there."""
    found = page.evaluate(_CENTRE, selector)
    return None if found is None else (found[0], found[1])


def take_paddle(page: Page) -> None:
    """Let the arm get ready for guiding, and take the paddle."""
    page.locator("#teach-modes").get_by_role("button", name="Guide").click()
    page.get_by_role("button", name="Let me guide").click()
    expect(page.locator("#teach-turn")).to_contain_text("take the green paddle", timeout=1000 * LED_S)
    paddle = centre(page, "#teach-paddle")
    assert paddle is not None
    page.mouse.move(*paddle)
    page.mouse.down()
    expect(page.locator("#teach-turn")).to_contain_text("you lead")


def follow_pacer(page: Page, verdict: str) -> None:
    """Keep the paddle on the pacer until a verdict begins like this."""
    deadline_s = time.monotonic() + LED_S
    while not page.locator("#teach-verdict").inner_text().startswith(verdict):
        assert time.monotonic() < deadline_s, page.locator("#teach-turn").inner_text()
        place = centre(page, "#teach-pacer")
        if place is not None:
            page.mouse.move(*place)
        page.wait_for_timeout(30)
    page.mouse.up()


def wait_until_free(page: Page) -> None:
    """Wait until nobody leads."""
    expect(page.locator("#teach-turn")).to_have_text("nobody leads", timeout=1000 * LED_S)
