"""Recorded strokes as the learning library takes them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import parse_topic_names
from msrd_ros.core.errors import UserError
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.recordings.episodes import read_bags
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.loading import default_robot, load_robot
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations


def demonstrations(
    folder: Path | str,
    robot: Path | str | None = None,
    labels: Sequence[str] = (),
    topics: Sequence[str] = (),
) -> Demonstrations:
    """The strokes in a folder of bags, for `msrd_ros.learning.train`.

    What fails the inspection is left out, with a warning that says why.

    Parameters
    ----------
    folder
        Of bags; or one bag, or an MCAP file.
    robot
        The arm that was led: a name or a folder, as nodes take it; None: the default one.
    labels
        Strategies that are wanted; empty: all that are there.
    topics
        What topics are called in the bags, as ``NAME:=NAME_IN_BAG``.

    Raises
    ------
    UserError
        If there are no bags, none shows a wanted strategy, or nothing of them can be used.
    """
    arm = default_robot() if robot is None else load_robot(robot)
    wanted = [StrategyLabel.parse(label, "labels") for label in labels]
    names = parse_topic_names(list(topics), "topics")
    library = BagLibrary.scan(folder)
    refused = list(library.refused)
    episodes: list[Episode] = []
    for reading in read_bags(library.select(wanted), arm, names):
        refused += [f"bag {reading.info.path}: {reason}" for reason in reading.refused]
        episodes += reading.episodes
    if not episodes:
        raise UserError(f"folder {folder}: no demonstration is left; {refused[0]}")
    for line in refused:
        warnings.warn(f"left out: {line}", stacklevel=2)
    return gather_demonstrations(episodes, Strategies.shipped())
