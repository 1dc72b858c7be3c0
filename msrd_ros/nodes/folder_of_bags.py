"""Demonstrations that lie in a folder of bags, read with a progress bar; what is left out is said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rclpy.impl.rcutils_logger import RcutilsLogger
from tqdm import tqdm

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.played_bags import COUNT
from msrd_ros.recordings.episodes import read_bags
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.robot import Robot


def read_folder(
    folder: Path,
    labels: Sequence[StrategyLabel],
    subjects: Sequence[str],
    robot: Robot,
    names: Mapping[str, str],
    log: RcutilsLogger,
    unlabelled: bool = False,
) -> list[Episode]:
    """Accepted demonstrations of a folder.

    Parameters
    ----------
    folder
        The bags.
    labels, subjects
        What is wanted; empty for all.
    robot
        Whose bags are read.
    names
        What topics are called in the bags.
    log
        Is told what is left out, and why.
    unlabelled
        Whether strokes without a label are wanted, too.

    Raises
    ------
    UserError
        If none is left.
    """
    library = BagLibrary.scan(folder)
    chosen = library.select(labels, subjects)
    refused = list(library.refused)
    notes: Counter[str] = Counter()
    episodes: list[Episode] = []
    for reading in tqdm(
        read_bags(chosen, robot, names, unlabelled), total=len(chosen), unit="bag", desc="read"
    ):
        episodes += [episode for episode in reading.episodes if not labels or episode.label in labels]
        refused += [f"bag {reading.info.path}: {reason}" for reason in reading.refused]
        notes.update(COUNT.sub("", note) for note in reading.notes)
    if not episodes:
        raise UserError(f"no demonstration is left; {refused[0] if refused else folder}")
    for line in refused:
        log.warning(f"left out: {line}")
    for note, bags in notes.items():
        log.warning(f"{note} ({bags} bags)")
    left_out = f", {len(refused)} left out" if refused else ""
    log.info(f"{len(episodes)} demonstrations from {folder}{left_out}")
    return episodes
