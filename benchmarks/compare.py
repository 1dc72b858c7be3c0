"""Ours beside others', in one table: `make benchmarks`.

Run from the repository: ``python benchmarks/compare.py [--only learning simulators reading recording topics
start] [--out out/benchmarks]``. What is compared with is installed into environments below the output
folder, once, as its pins do not fit ours. The table is printed, and written to ``benchmarks.md`` there after
every part.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
# Policies and processes made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "benchmarks"), str(CHECKOUT / "test" / "helpers")]
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import bags  # noqa: E402
import simulator  # noqa: E402
from side_by_side import learning, reading, simulators, start_up  # noqa: E402
from side_by_side.rivals import NotInstalledError  # noqa: E402
from side_by_side.table import Comparison, markdown  # noqa: E402

JOINT_HZ = 1000.0
RECORDING_NOTE = (
    "joint states at 1 kHz and ball at 200 Hz for a minute; theirs is what was sent over the wire"
)
TOPICS_NOTE = "strokes in lockstep through simulator and executor, each a process; theirs is the wall clock"
EPISODES = 48


def recording() -> Iterator[Comparison]:
    """How much of the wire is in the bags."""
    with tempfile.TemporaryDirectory() as folder:
        done = bags.record(Path(folder), 60.0, JOINT_HZ)
    sent, kept = (count / done.seconds for count in (done.sent, done.sent - done.lost))
    yield Comparison("recording", "messages/s", kept, "the wire", sent, note=RECORDING_NOTE)
    yield Comparison("recording: of a core", "%", 100 * done.core, note=RECORDING_NOTE)


def topics() -> Iterator[Comparison]:
    """How much faster than the wall clock the stack plays."""
    played = simulator.over_topics(EPISODES)
    rate = played.rate.real_time
    yield Comparison("the stack over topics", "x", rate, "real time", 1.0, note=TOPICS_NOTE)
    for name, tick_ms in played.tick_ms.items():
        what = f"the stack over topics: a tick of the {name}"
        yield Comparison(what, "ms of the processor", tick_ms, less_is_better=True, note=TOPICS_NOTE)


def main() -> int:
    """Measure what is asked for; the exit status is 1 if a part could not be."""
    parts: dict[str, Callable[[], Iterator[Comparison]]] = {
        "learning": lambda: learning.compare(words.out),
        "simulators": lambda: simulators.compare(words.out, EPISODES),
        "reading": lambda: reading.compare(CHECKOUT / "bags"),
        "recording": recording,
        "topics": topics,
        "start": start_up.compare,
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=list(parts), default=list(parts), help="which parts")
    parser.add_argument("--out", type=Path, default=CHECKOUT / "out" / "benchmarks", help="folder to write")
    words = parser.parse_args()
    words.out = words.out.resolve()
    words.out.mkdir(parents=True, exist_ok=True)
    head = (
        f"{os.cpu_count()} cores, Python {platform.python_version()}; load of the machine at the start "
        f"{os.getloadavg()[0]:.1f}."
    )
    lines: list[Comparison] = []
    failed = 0
    for name in words.only:
        print(f"{name} ...", file=sys.stderr, flush=True)
        try:
            lines += parts[name]()
        except NotInstalledError as error:
            print(f"{name}: {error}", file=sys.stderr)
            failed = 1
        (words.out / "benchmarks.md").write_text(markdown(lines, head), encoding="utf-8")
    print(markdown(lines, head))
    return failed


if __name__ == "__main__":
    sys.exit(main())
