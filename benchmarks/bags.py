"""How fast bags are written, read and recorded, and whether the recorder loses messages.

Run from the repository: ``python benchmarks/bags.py [--strokes 50] [--seconds 60] [--joint-hz 1000]``.
"write" and "read" go through one process. "record" streams joint states and ball from this process to a
recorder process over DDS, on the wall clock, without a pause. "replay" plays what was recorded from a player
process, as fast as it does by default, to a recorder that keeps it again. The exit status is 1 if a message
was lost.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from rclpy.utilities import try_shutdown
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

CHECKOUT = Path(__file__).resolve().parent.parent
# The strokes, publishers and processes made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]

from msrd_ros.bags.reader import Bag  # noqa: E402
from msrd_ros.bags.schemas import typestore  # noqa: E402
from msrd_ros.bags.writer import keep_stroke  # noqa: E402
from msrd_ros.contract.labels import StrategyLabel  # noqa: E402
from msrd_ros.contract.topics import BagMessage  # noqa: E402
from msrd_ros.recordings.episodes import read_episodes  # noqa: E402
from msrd_ros.recordings.library import BagLibrary  # noqa: E402
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS  # noqa: E402
from processes import Installation, Launcher  # noqa: E402
from stroke_source import SENT, StrokeSource  # noqa: E402
from synthetic_strokes import at_root, described, stroke_messages, topics_of  # noqa: E402

DOMAIN_ID = 97
ALL_HEARD = "hears joint_states, ball/position, feed, strategy, rally/outcome$"
STROKE_S = 2.26


def timed(what: str, bags: int, messages: int, work: Callable[[], object]) -> None:
    """Print how long one bag takes, and the rate of messages."""
    begin = time.perf_counter()
    work()
    seconds = time.perf_counter() - begin
    print(f"{what:34s} {1e3 * seconds / bags:8.2f} ms a bag {messages / seconds:10.0f} messages a second")


def write_and_read(folder: Path, strokes: int) -> None:
    """Time writing, scanning and reading of strokes at 250 Hz joint states and 200 Hz ball."""
    label = ALL_LABELS[0]
    stroke = [described(), *stroke_messages(str(label))]
    topics, messages = topics_of(stroke), at_root(stroke)
    total = strokes * len(messages)

    def write_with_rosbags() -> None:
        for number in range(strokes):
            writer = Writer(folder / f"rosbags_{number}", version=9, storage_plugin=StoragePlugin.MCAP)
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            with writer:
                connections = {
                    topic.name: writer.add_connection(topic.name, topic.type_name, typestore=typestore())
                    for topic in topics
                }
                for message in messages:
                    writer.write(connections[message.topic], message.log_time_ns, message.data)

    def write() -> None:
        for _ in range(strokes):
            keep_stroke(folder / "ours", "s01", label, topics, messages, {"outcome": "returned"})

    timed("write, rosbags, not synced", strokes, total, write_with_rosbags)
    timed("write, synced and renamed", strokes, total, write)
    timed("scan the folder (metadata alone)", strokes, total, lambda: BagLibrary.scan(folder / "ours"))
    bags = [Bag(info.path) for info in BagLibrary.scan(folder / "ours").bags]
    timed("read as bytes, sums checked", strokes, total, lambda: [bag.raw() for bag in bags])
    timed("read as messages", strokes, total, lambda: [list(bag.entries()) for bag in bags])
    timed("read as episodes", strokes, total, lambda: [read_episodes(bag) for bag in bags])
    size = sum(file.stat().st_size for file in bags[0].info.path.iterdir())
    print(f"{len(messages)} messages a bag, {size / 1e3:.0f} kB\n")


def sessions(seconds: float, joint_hz: float) -> Iterator[tuple[StrategyLabel, list[BagMessage]]]:
    """Strokes back to back on the wall clock, made beforehand."""
    begin_ns = time.time_ns() + 10_000_000_000
    for number in range(max(1, round(seconds / STROKE_S))):
        label = ALL_LABELS[number % len(ALL_LABELS)]
        start_ns = begin_ns + int(number * STROKE_S * 1e9)
        yield label, stroke_messages(str(label), start_ns, joint_hz=joint_hz, ball_id=number)


class Recording(NamedTuple):
    """What became of a stream: messages sent and lost, all faults, its length in s, the recorder's cores."""

    sent: int
    lost: int
    faults: int
    seconds: float
    core: float


def record(folder: Path, seconds: float, joint_hz: float) -> Recording:
    """Stream strokes to a recorder."""
    os.environ.update(ROS_DOMAIN_ID=str(DOMAIN_ID), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    rclpy.init()
    launcher = Launcher(Installation("checkout", checkout=True), DOMAIN_ID, folder)
    try:
        source = StrokeSource(rclpy.create_node("source"), SENT)
        process = launcher.start("recorder", parameters={"directory": folder / "recorded"})
        process.wait_for_line(ALL_HEARD)
        source.wait_for_match()
        strokes = list(sessions(seconds, joint_hz))
        late_s = 0.0
        for _, stroke in strokes:
            source.send_in_time(stroke)
            late_s = max(late_s, (time.time_ns() - stroke[-1].log_time_ns) / 1e9)
        cpu_s = process.cpu_seconds()
        source.verdict(len(strokes))
        source.diagnostics.clear()
        source.wait_until(lambda: source.diagnostics, "diagnostics")
        sent = sum(len(stroke) for _, stroke in strokes)
        lost = int(source.diagnostics["messages_lost"])
        gaps = sum(gaps_in(Bag(verdict["path"])) for verdict in source.verdicts if verdict["path"])
        kept = sum(verdict["kept"] == "true" for verdict in source.verdicts)
        span_s = (strokes[-1][1][-1].log_time_ns - strokes[0][1][0].log_time_ns) / 1e9
        print(
            f"record {span_s:.0f} s at {joint_hz:.0f} Hz joint states and 200 Hz ball: {sent} messages sent "
            f"(at worst {1e3 * late_s:.0f} ms late), {lost} lost, {gaps} gaps in bags, "
            f"{kept} of {len(strokes)} strokes kept, recorder {100 * cpu_s / span_s:.0f} % of a core"
        )
        for verdict in source.verdicts:
            if verdict["kept"] != "true":
                print(f"  ball {verdict['ball_id']}: {verdict['reason']}, {verdict['detail']}")
        return Recording(sent, lost, lost + gaps + len(strokes) - kept, span_s, cpu_s / span_s)
    finally:
        launcher.close()
        try_shutdown()


def replay(folder: Path) -> int:
    """Play the recorded bags into a second recorder; how many strokes did not come out as they went in."""
    launcher = Launcher(Installation("checkout", checkout=True), DOMAIN_ID, folder)
    try:
        recorder = launcher.start("recorder", parameters={"directory": folder / "again"})
        recorder.wait_for_line("ready")
        parameters = {"bags": f"[{folder / 'recorded'}]", "rate": 0.0, "start_delay_s": 2.0}
        player = launcher.start("player", parameters=parameters)
        told = player.wait_for_line(r"played (\d+) bags, (\d+) messages in (\S+) s", timeout_s=600.0)
        recorder.stop()
        bags, messages, seconds = int(told[1]), int(told[2]), float(told[3])
        again = BagLibrary.scan(folder / "again").bags
        differ = sum(
            not same_arrays(info.path, folder / "recorded" / "s01" / info.path.name) for info in again
        )
        print(
            f"replay {bags} bags: {messages / seconds:.0f} messages a second; "
            f"{len(again)} strokes recorded again, arrays of {differ} differ"
        )
        return bags - len(again) + differ
    finally:
        launcher.close()


def same_arrays(first: Path, second: Path) -> bool:
    """Whether two bags are one and the same episode to a learner."""
    (one,), (other,) = read_episodes(Bag(first)), read_episodes(Bag(second))
    return np.array_equal(one.observations, other.observations) and np.array_equal(one.actions, other.actions)


def gaps_in(bag: Bag) -> int:
    """Breaks in the publication sequence numbers of the state topics."""
    gaps = 0
    messages = bag.raw()
    for topic in ("/joint_states", "/ball/position"):
        numbers = [message.sequence for message in messages if message.topic == topic]
        gaps += sum(second != first + 1 for first, second in pairwise(numbers))
    return gaps


def main() -> int:
    """Print all measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strokes", type=int, default=50, help="bags to write and read")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="length of the recording; 0 leaves it out"
    )
    parser.add_argument("--joint-hz", type=float, default=1000.0, help="rate of the joint states")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        write_and_read(Path(folder), options.strokes)
        failed = 0
        if options.seconds:
            failed = record(Path(folder), options.seconds, options.joint_hz).faults + replay(Path(folder))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
