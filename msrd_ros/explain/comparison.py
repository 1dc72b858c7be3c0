"""Two strokes beside each other, with their hits at the same time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.explain.explanation import Explanation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """Two strokes at the same K times since their hits, as long as both go on.

    Attributes
    ----------
    time_s
        Since the hit, shape (K,); 0 is among them.
    ball, paddle
        Shape (2, K, 3), m.
    task
        R0, shape (2, K).
    strategy
        Every S_i, shape (2, K, N).
    """

    time_s: Array
    ball: Array
    paddle: Array
    task: Array
    strategy: Array

    @property
    def ball_apart_m(self) -> Array:
        """How far apart the balls are, shape (K,)."""
        return np.asarray(np.linalg.norm(self.ball[1] - self.ball[0], axis=-1))

    @property
    def paddle_apart_m(self) -> Array:
        """How far apart the paddles are, shape (K,)."""
        return np.asarray(np.linalg.norm(self.paddle[1] - self.paddle[0], axis=-1))


def compare(first: Explanation, second: Explanation) -> Comparison:
    """Lay two strokes over each other at their hits; between two samples everything counts as linear.

    Raises
    ------
    ValueError
        If they were explained by rewards of other strategies.
    """
    if first.labels != second.labels:
        raise ValueError(f"explained by rewards of {first.labels} and of {second.labels}")
    pair = (first, second)
    begin = max(float(one.time_s[0]) - one.hit_s for one in pair)
    end = min(float(one.time_s[-1]) - one.hit_s for one in pair)
    first_step, last_step = math.ceil(begin / CONTROL_PERIOD_S), math.floor(end / CONTROL_PERIOD_S)
    time_s = CONTROL_PERIOD_S * np.arange(first_step, last_step + 1, dtype=np.float64)

    def at(one: Explanation, values: Array) -> Array:
        columns = values.reshape(len(values), -1).T
        found = [np.interp(time_s, one.time_s - one.hit_s, column) for column in columns]
        return np.stack(found, axis=1).reshape(len(time_s), *values.shape[1:])

    return Comparison(
        time_s,
        np.stack([at(one, one.ball) for one in pair]),
        np.stack([at(one, one.paddle) for one in pair]),
        np.stack([at(one, one.task) for one in pair]),
        np.stack([at(one, one.strategy) for one in pair]),
    )
