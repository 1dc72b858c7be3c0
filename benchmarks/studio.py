"""What the studio costs and how it looks: first picture, frames a second, balls a minute, memory.

Run from the repository: ``python benchmarks/studio.py [PART ...]``, on a machine that does nothing else; it
needs Debian's chromium.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

CHECKOUT = Path(__file__).resolve().parent.parent
# Processes, domains and browsers made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import aiohttp  # noqa: E402
import numpy as np  # noqa: E402
import viser  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from playwright.sync_api import Page, expect  # noqa: E402

from browser import open_page  # noqa: E402
from domains import reserved_domain  # noqa: E402
from msrd_ros.nodes.common import EVENT  # noqa: E402
from processes import RunningProcess  # noqa: E402
from scene_pictures import is_drawn  # noqa: E402
from soak import measure  # noqa: E402
from stack import START_TIMEOUT_S, Stack  # noqa: E402
from studio_stack import POLICIES, free_port, wait_for_page  # noqa: E402

STROKES = 10
PAIRS = 3
WINDOW_S = 30.0
"""Of balls counted with a client, and as long without one."""
BALLS = 1000
STROKE_S = 4.0
"""From a feed to the arm's rest, with room."""

COUNT_FRAMES = """
window.changed = [];
const told = new Map();
let due = false;
function look(value) {
  if (Array.isArray(value)) return value.forEach(look);
  if (!value || typeof value !== "object" || ArrayBuffer.isView(value)) return;
  if (typeof value.name === "string" && value.name.startsWith("/arm/") && value.wxyz) {
    const text = [...value.wxyz].join();
    due ||= told.has(value.name) && told.get(value.name) !== text;
    told.set(value.name, text);
    return;
  }
  Object.values(value).forEach(look);
}
function frame(now) {
  if (due) { window.changed.push(now); due = false; }
  requestAnimationFrame(frame);
}
// Not before: the page unpacks itself into a document of its own.
window.Worker = class extends Worker {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", (event) => look(event.data));
    requestAnimationFrame(frame);
  }
};
"""
"""In the scene: remember the animation frames before which a pose of the arm came that is not the last one.

The scene decodes its messages on a worker and hands them to the page that draws.
"""


class Studio:
    """Simulator, executor, evaluator that feeds without end if wanted, and studio."""

    def __init__(self, stack: Stack, rate: float, feeds: bool) -> None:
        self.stack = stack
        self.outcomes = 0
        stack.node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT)
        stack.start_simulator(seed=3, rate=rate)
        stack.start("executor", checkpoint=str(POLICIES))
        self.process: RunningProcess = stack.start("studio", port=free_port())
        self.address = wait_for_page(stack, self.process)
        if feeds:
            stack.start("evaluator", labels="[forehand-push]", balls=100_000, timeout_s=60.0)
            self.play(2)

    def _on_outcome(self, _: DiagnosticArray) -> None:
        self.outcomes += 1

    def play(self, balls: int) -> None:
        """Wait for so many outcomes."""
        wanted = self.outcomes + balls
        self.stack.wait_until(lambda: self.outcomes >= wanted, "balls", START_TIMEOUT_S)

    def balls_a_minute(self, seconds: float) -> float:
        """Counted from one outcome to another."""
        self.play(1)
        begin_s, begun = time.monotonic(), self.outcomes
        self.stack.wait_until(lambda: time.monotonic() > begin_s + seconds, "end", 2 * seconds)
        self.play(1)
        return 60.0 * (self.outcomes - begun) / (time.monotonic() - begin_s)


@contextmanager
def studio(rate: float, feeds: bool) -> Iterator[Studio]:
    """All nodes on a domain of their own."""
    with TemporaryDirectory() as folder, reserved_domain() as domain, Stack(domain, Path(folder)) as stack:
        yield Studio(stack, rate, feeds)


@contextmanager
def client(address: str) -> Iterator[None]:
    """Takes all that a page is sent, and draws nothing."""
    loop = asyncio.new_event_loop()

    async def take(path: str, *protocols: str) -> None:
        async with (
            aiohttp.ClientSession(headers={"Origin": address}) as session,
            session.ws_connect(address + path, protocols=protocols, max_msg_size=0) as socket,
        ):
            async for _ in socket:
                pass

    async def take_all() -> None:
        await asyncio.gather(take("/live"), take("/scene/", f"viser-v{viser.__version__}"))

    task = loop.create_task(take_all())
    thread = threading.Thread(target=loop.run_until_complete, args=(asyncio.wait([task]),), daemon=True)
    thread.start()
    try:
        yield
        if task.done():
            task.result()
            raise RuntimeError("the client was let go")
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join()


# -- parts -----------------------------------------------------------------------------------------


def first_picture() -> dict[str, Any]:
    """Seconds from opening the page of a running stack to a picture with table and arm in it."""
    with studio(1.0, feeds=False) as one, open_page("about:blank") as page:
        begin_s = time.monotonic()
        page.goto(one.address)
        while not is_drawn(page):
            pass
        return {"first_picture_s": time.monotonic() - begin_s}


def frames() -> dict[str, Any]:
    """Frames a second in which the arm has moved, while it plays a stroke in real time."""
    with studio(1.0, feeds=False) as one, open_page("about:blank") as page:
        page.context.add_init_script(COUNT_FRAMES)
        page.goto(one.address)
        expect(page.locator("#phase")).to_contain_text("waits", timeout=1000 * START_TIMEOUT_S)
        page.get_by_role("button", name="forehand-topspin", exact=True).click()
        rates = [_frames_of_a_stroke(page) for _ in range(STROKES)]
    return {"frames_a_second": statistics.median(rates), "worst": min(rates), "best": max(rates)}


def _frames_of_a_stroke(page: Page) -> float:
    scene = next(frame for frame in page.frames if "/scene/" in frame.url)
    expect(page.locator("#phase")).to_contain_text("waits")
    page.wait_for_timeout(1500)  # on the way back to its ready pose the arm moves, too
    scene.evaluate("window.changed.length = 0")
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#phase")).to_have_text("plays")
    page.wait_for_timeout(1000 * STROKE_S)
    times = np.array(scene.evaluate("window.changed")) / 1000.0
    # The arm rests between the stroke and the way back.
    stroke = times[: int(np.flatnonzero(np.diff(times, append=np.inf) > 0.5)[0]) + 1]
    return float((len(stroke) - 1) / (stroke[-1] - stroke[0]))


def balls() -> dict[str, Any]:
    """Balls a minute in lockstep without a client and with one, in turns."""
    alone, watched = [], []
    with studio(0.0, feeds=True) as one:
        for number in range(2 * PAIRS):
            if number % 4 in (0, 3):
                alone.append(one.balls_a_minute(WINDOW_S))
            else:
                with client(one.address):
                    watched.append(one.balls_a_minute(WINDOW_S))
        with open_page(one.address) as page:
            expect(page.locator("#phase")).to_contain_text("plays")
            drawn = one.balls_a_minute(WINDOW_S)
    ratios = [with_one / without for with_one, without in zip(watched, alone, strict=True)]
    return {
        "balls_a_minute": statistics.median(alone),
        "with_a_client": statistics.median(watched),
        "ratio": statistics.median(ratios),
        "ratios": ratios,
        "with_chromium_drawing": drawn,
    }


def memory() -> dict[str, Any]:
    """Memory, handles and threads of the studio over many balls with a client."""
    with studio(0.0, feeds=True) as one, client(one.address):
        one.play(BALLS // 10)
        begin = measure(one.process.pid)
        for _ in range(9):
            one.play(BALLS // 10)
        return {"balls": BALLS, "after_a_tenth": begin, "at_the_end": measure(one.process.pid)}


PARTS = {part.__name__: part for part in (first_picture, frames, balls, memory)}


def main() -> int:
    """Run the parts that are asked for, all by default; print a line of JSON each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("parts", nargs="*", default=list(PARTS), choices=[*PARTS], metavar="PART")
    for name in parser.parse_args().parts:
        print(json.dumps({name: PARTS[name]()}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
