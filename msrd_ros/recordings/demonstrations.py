"""Recorded strokes as the learning library takes them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import read_label
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

    What fails the inspection or has no label is left out, with a warning that says why and what to do.

    Parameters
    ----------
    folder, robot, labels, topics
        As of `load_strokes`.

    Raises
    ------
    UserError
        If there are no bags, none shows a wanted strategy, or nothing of them can be used.
    """
    return gather_demonstrations(load_strokes(folder, robot, labels, topics), Strategies.shipped())


def load_strokes(
    folder: Path | str,
    robot: Path | str | None = None,
    labels: Sequence[str] = (),
    topics: Sequence[str] = (),
    unlabelled: bool = False,
) -> list[Episode]:
    """The strokes in a folder of bags one by one, each with its label, subject and bag.

    What fails the inspection is left out, with a warning that says why. To have strategies found among
    strokes without a label, load them with `unlabelled`, give each a label with `dataclasses.replace`, and
    hand them to `gather_demonstrations`.

    Parameters
    ----------
    folder
        Of bags; or one bag, or an MCAP file.
    robot
        The arm that was led: a name or a folder, as nodes take it; None: the default one.
    labels
        Strategies that are wanted, ``unlabelled`` for strokes without one; empty: all that are there.
    topics
        What topics are called in the bags, as ``NAME:=NAME_IN_BAG``.
    unlabelled
        Load strokes without a label as well, with None for it; else they are left out like what fails.

    Raises
    ------
    UserError
        If there are no bags, none shows a wanted strategy, or nothing of them can be used.
    """
    arm = default_robot() if robot is None else load_robot(robot)
    wanted = [read_label(label, "labels") for label in labels]
    names = parse_topic_names(list(topics), "topics")
    library = BagLibrary.scan(folder)
    refused = list(library.refused)
    episodes: list[Episode] = []
    for reading in read_bags(library.select(wanted), arm, names, unlabelled):
        refused += [f"bag {reading.info.path}: {reason}" for reason in reading.refused]
        episodes += reading.episodes
    if not episodes:
        raise UserError(f"folder {folder}: no demonstration is left; {refused[0]}")
    for line in refused:
        warnings.warn(f"left out: {line}", stacklevel=2)
    return episodes
