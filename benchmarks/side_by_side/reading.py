"""The strokes that ship, read as messages: by us, by `rosbags` and by `mcap-ros2-support`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader

from msrd_ros.bags.reader import Bag
from msrd_ros.recordings.library import BagLibrary
from side_by_side.table import Comparison

ROUNDS = 3
NOTE = "the bags that ship, every message deserialised, the best of three rounds; seconds of the processor"


def ours(folder: Path) -> int:
    """How many messages our reader hands over."""
    return sum(1 for _ in Bag(folder).entries())


def with_rosbags(folder: Path) -> int:
    """The same with rosbags."""
    with AnyReader([folder]) as reader:
        return sum(1 for line, _, data in reader.messages() if reader.deserialize(data, line.msgtype))


def with_mcap_ros2(folder: Path) -> int:
    """The same with mcap's reader of ROS 2 messages."""
    file = next(folder.glob("*.mcap"))
    return sum(1 for message in read_ros2_messages(str(file)) if message.ros_msg is not None)


def rate(read: Callable[[Path], int], folders: list[Path]) -> float:
    """Messages a second of the processor, in the best of some rounds."""
    best = 0.0
    for _ in range(ROUNDS):
        begin = time.process_time()
        count = sum(map(read, folders))
        best = max(best, count / (time.process_time() - begin))
    return best


def compare(bags: Path) -> Iterator[Comparison]:
    """Lines of the table, of all bags below a folder."""
    folders = [info.path for info in BagLibrary.scan(bags).bags]
    mine = rate(ours, folders)
    for package, read in (("rosbags", with_rosbags), ("mcap-ros2-support", with_mcap_ros2)):
        yield Comparison(
            "reading bags",
            "messages/s",
            mine,
            f"{package} {version(package)}",
            rate(read, folders),
            note=NOTE,
        )
