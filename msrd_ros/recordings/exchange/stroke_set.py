"""A folder of bags as what a data set holds: accepted strokes as rows, and all bags beside them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.finding import find_bags, require_bags_at
from msrd_ros.bags.info import read_info
from msrd_ros.contract.columns import ACTION, ENVIRONMENT_STATE, JOINT_VELOCITY, STATE
from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_bags
from msrd_ros.robots.robot import Robot

BAG, STROKE = "bag", "stroke"
"""What tells a data set's episode from which bag it is, and which of its accepted strokes."""


@dataclass(frozen=True)
class SetStroke:
    """An accepted stroke.

    Attributes
    ----------
    episode
        Its arrays.
    bag
        Its bag's path below the folder.
    stroke
        Which of the bag's accepted strokes, from 0.
    """

    episode: Episode
    bag: str
    stroke: int

    def facts(self) -> dict[str, str | int]:
        """What a data set says of it beside its rows: the same keys in each."""
        episode = self.episode
        return {
            "label": str(episode.label or ""),
            "subject": episode.subject,
            "outcome": "" if episode.outcome is None else episode.outcome.message,
            "start_ns": -1 if episode.start_ns is None else episode.start_ns,
            BAG: self.bag,
            STROKE: self.stroke,
        }


@dataclass(frozen=True)
class StrokeSet:
    """What is at or below a folder.

    Attributes
    ----------
    robot
        The arm that was led.
    names
        Full topic name in the bags by relative name, as it was said.
    strokes
        Accepted ones, by their bags' paths.
    bags
        Where each bag lies, by its path below the folder: also those of which nothing is accepted.
    refused
        Why, by the bag's path below the folder.
    """

    robot: Robot
    names: Mapping[str, str]
    strokes: tuple[SetStroke, ...]
    bags: Mapping[str, Path]
    refused: Mapping[str, str]


def read_stroke_set(folder: Path, robot: Robot, names: Mapping[str, str]) -> StrokeSet:
    """Inspect all bags at or below a folder.

    Parameters
    ----------
    folder
        A folder, a bag or an MCAP file.
    robot
        The arm that was led.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.

    Raises
    ------
    UserError
        If there is no such folder, or nothing in it is accepted.
    """
    require_bags_at(folder, str(folder))
    strokes: list[SetStroke] = []
    refused: dict[str, str] = {}
    bags = {_below(path, folder): path for path in find_bags(folder)}
    for name, path in bags.items():
        episodes, reason = accepted(path, robot, names)
        strokes += [SetStroke(episode, name, number) for number, episode in enumerate(episodes)]
        if reason:
            refused[name] = reason
    if not strokes:
        first = next((f"{name}: {reason}" for name, reason in refused.items()), "it holds no bags")
        raise UserError(f"folder {folder}: no stroke is accepted; {first}")
    return StrokeSet(robot, names, tuple(strokes), bags, refused)


def accepted(path: Path, robot: Robot, names: Mapping[str, str]) -> tuple[tuple[Episode, ...], str]:
    """The accepted strokes of a bag, labelled or not, and why others are not."""
    try:
        info = read_info(path)
    except UserError as error:
        return (), str(error).removeprefix(f"bag {path}: ")
    (reading,) = read_bags([info], robot, names, unlabelled=True)
    return reading.episodes, "; ".join(reading.refused)


def state_rows(episode: Episode) -> dict[str, NDArray[np.float64]]:
    """What `contract.columns.stroke_contract` names, by feature: shape (T, width), T the number of actions.

    The state after the last action has no row.
    """
    length = len(episode.actions)
    ball = np.concatenate([episode.ball_position, episode.ball_velocity], axis=1)
    return {
        STATE: episode.joint_position[:length],
        ENVIRONMENT_STATE: ball[:length],
        ACTION: episode.actions,
        JOINT_VELOCITY: episode.joint_velocity[:length],
    }


def _below(path: Path, folder: Path) -> str:
    below = os.path.relpath(path, folder)
    return folder.resolve().name if below == "." else Path(below).as_posix()
