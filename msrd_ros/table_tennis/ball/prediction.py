"""What becomes of a ball if the paddle moves as is known: the rally itself, without the arm's dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.outcome import Outcome
from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.flight import BALL_SIZE
from msrd_ros.table_tennis.ball.referee import IN_PLAY, new_referees, outcome_of
from msrd_ros.table_tennis.ball.step import step_ball

Array = NDArray[np.float64]

_LONGEST_S = 3.0
_LINGER_S = 0.3
"""How long a ball is followed after the referee has decided, for the looks."""


class Prediction(NamedTuple):
    """A ball from its launch until a moment after its decision.

    Attributes
    ----------
    times_s
        Since the launch, shape (T,).
    path
        States of the ball there, shape (T, 9), SI.
    outcome
        What the referee says: where it lands or why it does not, and the spin after the hit.
    """

    times_s: Array
    path: Array
    outcome: Outcome


@njit(cache=True, nogil=True)
def _play(
    ball: Array,
    paddles: Array,
    period: float,
    referee: NDArray[np.void],
    linger: int,
    scene: NDArray[np.void],
    path: Array,
) -> int:
    """Fill `path` (T, 9) and return how many rows of it were needed."""
    here = ball.copy()
    path[0] = here
    last, left = len(paddles) - 1, linger
    for index in range(1, len(path)):
        before, after = paddles[min(index - 1, last)], paddles[min(index, last)]
        step_ball(here, referee, before, after, (index - 1) * period, period, scene)
        path[index] = here
        if referee[0].verdict != IN_PLAY:
            left -= 1
            if left <= 0:
                return index + 1
    return len(path)


def predict_rally(ball: Array, paddles: Array, period_s: float, scene: NDArray[np.void]) -> Prediction:
    """Fly a ball past a moving paddle, with the touches and the referee of the rally.

    Parameters
    ----------
    ball
        At its launch, shape (9,).
    paddles
        The paddle from the launch on, rows `period_s` apart, shape (P, 12) as in `surfaces`; then it stays.
    period_s
        At most 5 ms.
    scene
        `Scene.constants()`.
    """
    path = np.empty((round(_LONGEST_S / period_s) + 1, BALL_SIZE))
    referee = new_referees(1)
    rows = _play(ball, paddles, period_s, referee, round(_LINGER_S / period_s), scene, path)
    times = np.arange(rows, dtype=np.float64) * period_s
    return Prediction(times, path[:rows], outcome_of(referee, 0))
