"""`python docs/take_pictures.py [RUN]`: take the documents' pictures of the studio anew.

RUN is the folder of a training run whose rewards are shown; ``out/demo/training`` of `make demo` if left out.
It needs Debian's chromium and the extra `test`.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

DOCS = Path(__file__).resolve().parent
PORT = 8099
DOMAIN = "98"
START_S = 180
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def main() -> int:
    """Start a studio with the shipped strokes, and take its pictures."""
    run = sys.argv[1] if len(sys.argv) > 1 else "out/demo/training"
    words = ["up", "studio", f"port:={PORT}", f"bags:={DOCS.parent / 'bags'}", f"run:={run}"]
    words.append(f"runs:={Path(run).parent}")
    environment = {**os.environ, "ROS_DOMAIN_ID": DOMAIN}
    command = [sys.executable, "-m", "msrd_ros", *words]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as studio:
        assert studio.stdout is not None
        for line in studio.stdout:
            if "studio: open" in line:
                break
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(1000 * START_S)
            page.goto(f"http://127.0.0.1:{PORT}")
            taught(page)
            learned(page, Path(run).name)
            explained(page)
            browser.close()
        studio.send_signal(signal.SIGINT)
        studio.stdout.read()
    return 0


def taught(page: Page) -> None:
    """A stroke to begin with, sketched."""
    page.get_by_role("tab", name="Teach").click()
    page.locator("#teach-name").fill("my-drive")
    page.get_by_role("button", name="Begin").click()
    page.locator("#teach-foretold").get_by_text("Foretold").wait_for()
    page.wait_for_timeout(5000)
    page.screenshot(path=DOCS / "studio_teach.png")


def learned(page: Page, run: str) -> None:
    """A run with its curves and its strategy matrix."""
    page.get_by_role("tab", name="Learn").click()
    page.locator("#lessons summary").click()
    page.locator(f'#runs tbody tr[data-run="{run}"]').click()
    page.locator("#learning-curves polyline").first.wait_for()
    page.wait_for_timeout(2000)
    page.screenshot(path=DOCS / "studio_learn.png")


def explained(page: Page) -> None:
    """A stroke that rewards are asked about."""
    page.get_by_role("tab", name="Strokes").click()
    page.locator("#bags tbody tr").nth(3).click()
    page.locator("#scrub").wait_for()
    page.get_by_role("button", name="Whose is it?").click()
    page.locator("#told").wait_for()
    page.locator("#scrubber").fill("1.2")
    page.wait_for_timeout(5000)
    page.screenshot(path=DOCS / "studio.png")


if __name__ == "__main__":
    sys.exit(main())
