"""Strokes laid over each other: their paths, coloured by stroke or by what R0 says along them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, Episode
from msrd_ros.explain.explanation import Explanation
from msrd_ros.recordings.paddle import paddle_poses
from msrd_ros.studio.scene import LaidPath

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a4fb5", "#333333")
"""Of strokes that are compared, told apart by colour-blind people, too (Okabe and Ito)."""
_LOW, _MIDDLE, _HIGH = (np.array(colour, float) for colour in ((68, 1, 84), (33, 145, 140), (253, 231, 37)))
"""Of R0, from the lowest to the highest of the stroke: ends and middle of viridis."""


def compared(episodes: Sequence[Episode]) -> list[LaidPath]:
    """Each stroke in a colour of its own, as far as the arm acts."""
    return [
        LaidPath(
            episode.ball_position[: ACTING_STEPS + 1],
            paddle_poses(episode.robot, episode.joint_position[: ACTING_STEPS + 1]).place,
            _bytes(COLOURS[number % len(COLOURS)]),
        )
        for number, episode in enumerate(episodes)
    ]


def coloured_by_reward(told: Explanation) -> LaidPath:
    """One stroke, yellow where R0 is highest and violet where it is lowest."""
    spread = float(np.ptp(told.task)) or 1.0
    share = ((told.task - told.task.min()) / spread)[:, None]
    colours = np.where(
        share < 0.5, _LOW + 2.0 * share * (_MIDDLE - _LOW), _MIDDLE + (2.0 * share - 1.0) * (_HIGH - _MIDDLE)
    )
    return LaidPath(told.ball, told.paddle, np.stack([colours[:-1], colours[1:]], axis=1).astype(np.uint8))


def _bytes(colour: str) -> NDArray[np.uint8]:
    return np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)], np.uint8)
