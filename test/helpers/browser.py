"""A real browser, if this machine has one: Debian's chromium, driven by Playwright."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
REQUIRED = "MSRD_TEST_BROWSER"
"""Set to ``required`` where a missing browser is a failure, as in continuous integration."""
PATIENCE_S = 60.0
SIZE = {"width": 1280, "height": 800}
_ASK = """(request) => new Promise((resolve) => {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.onopen = () => socket.send(JSON.stringify(request));
    socket.onmessage = (event) => {
        const message = JSON.parse(event.data);
        if (message.type === "answer") resolve(message);
    };
})"""
_FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--mute-audio"]


def browser_path() -> str:
    """Where the browser is; without one the test is left out, or fails where one is required."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        say = pytest.fail if os.environ.get(REQUIRED) == "required" else pytest.skip
        say(f"no browser: none of {', '.join(NAMES)} is on the PATH (Debian, Ubuntu: apt install chromium)")
    return str(found)


def ask_unasked(page: Page, **request: object) -> dict[str, object]:
    """Ask the studio for something over a connection of its own, whatever the page would send; the answer."""
    answer: dict[str, object] = page.evaluate(_ASK, {**request, "id": 1})
    return answer


@contextmanager
def open_page(address: str) -> Iterator[Page]:
    """A page of a browser of its own, at an address."""
    path = browser_path()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=_FLAGS)
        page = browser.new_page(viewport={"width": SIZE["width"], "height": SIZE["height"]})
        # Without a graphics processor the first pictures keep the page busy.
        page.set_default_timeout(1000 * PATIENCE_S)
        expect.set_options(timeout=1000 * PATIENCE_S)
        page.goto(address)
        yield page
        browser.close()
