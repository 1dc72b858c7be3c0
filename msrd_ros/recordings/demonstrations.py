"""Recorded strokes as the learning library takes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.loading import default_robot, load_robot
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations


def demonstrations(
    folder: Path | str, robot: Path | str | None = None, labels: Sequence[str] = ()
) -> Demonstrations:
    """The strokes in a folder of bags, for `msrd_ros.learning.train`.

    Parameters
    ----------
    folder
        Of bags; or one bag.
    robot
        The arm that was led: a name or a folder, as nodes take it; None: the default one.
    labels
        Strategies that are wanted; empty: all that are there.

    Raises
    ------
    UserError
        If there are no bags, one of them is broken or of another robot, or none shows a wanted strategy.
    """
    arm = default_robot() if robot is None else load_robot(robot)
    wanted = [StrategyLabel.parse(label, "labels") for label in labels]
    chosen = BagLibrary.scan(folder, strict=True).select(wanted)
    episodes = [episode for info in chosen for episode in read_episodes(Bag(info.path), arm)]
    return gather_demonstrations(episodes, Strategies.shipped())
