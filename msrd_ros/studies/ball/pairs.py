"""Pairs of successive events of a rally: what a law makes of the first, beside the second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.studies.ball.law import BallLaw
from msrd_ros.studies.ball.recordings import Events
from msrd_ros.table_tennis.ball.flight import POSITION, SPIN, VELOCITY, fly
from msrd_ros.table_tennis.ball.rebound import rebound_rigid

Array = NDArray[np.float64]

SHORTEST_S, LONGEST_S = 0.03, 1.2
"""Between the two events, exclusive."""


@dataclass(frozen=True)
class Pairs:
    """N flights from one event to the next.

    Attributes
    ----------
    player, kind
        Of the first event, shape (N,).
    start, end
        Recorded states of both events, shape (N, 9).
    duration_s
        Between them, shape (N,).
    """

    player: NDArray[np.str_]
    kind: NDArray[np.str_]
    start: Array
    end: Array
    duration_s: Array

    def part(self, rows: NDArray[np.bool_]) -> Pairs:
        """Those of a mask (N,)."""
        return Pairs(
            self.player[rows], self.kind[rows], self.start[rows], self.end[rows], self.duration_s[rows]
        )

    @property
    def spin_rad_s(self) -> Array:
        """Size of the spin at the start, shape (N,)."""
        return np.asarray(np.linalg.norm(self.start[:, SPIN], axis=1))

    def __len__(self) -> int:
        return len(self.duration_s)


def pairs_to(events: Events, kind: str) -> Pairs:
    """Pairs whose second event is of a kind (``bounce`` or ``shot``) and whose first is no ``net``."""
    before, after = slice(None, -1), slice(1, None)
    duration = events.time_s[after] - events.time_s[before]
    measured = np.isfinite(events.balls)
    rows = (
        (events.rally[before] == events.rally[after])
        & (events.kind[before] != "net")
        & np.char.startswith(events.kind[after], kind)
        & (duration > SHORTEST_S)
        & (duration < LONGEST_S)
        & measured[before].all(axis=1)
        & measured[after, POSITION].all(axis=1)
    )
    return Pairs(
        events.player[before][rows],
        events.kind[before][rows],
        events.balls[before][rows],
        events.balls[after][rows],
        duration[rows],
    )


@njit(cache=True)
def _predict(
    start: Array,
    duration: Array,
    lag: float,
    scene: NDArray[np.void],
    arrived: Array,
    rebounded: Array,
) -> None:
    constants = scene[0]
    for row in range(len(start)):
        ball = start[row].copy()
        fly(ball, -lag, scene)
        ball[:3] = start[row, :3]
        fly(ball, duration[row], scene)
        arrived[row] = ball
        rebound_rigid(ball, 0.0, 0.0, 1.0, constants.table_restitution, constants.table_friction, constants)
        fly(ball, lag, scene)
        ball[:3] = arrived[row, :3]
        rebounded[row] = ball


def predict(pairs: Pairs, law: BallLaw) -> tuple[Array, Array]:
    """States at the second event, and after a rebound off the table there, as a recording would have them.

    The ball flies freely for the recorded duration: nothing stops it at the table. Both are of shape (N, 9).
    """
    arrived, rebounded = np.empty_like(pairs.start), np.empty_like(pairs.start)
    _predict(pairs.start, pairs.duration_s, law.velocity_lag_s, law.constants(), arrived, rebounded)
    return arrived, rebounded


@dataclass(frozen=True)
class Errors:
    """Of predicted states, shape (N,) each; NaN where nothing was measured.

    Position (m) at the second event, velocity (m/s) and spin (rad/s) after its rebound.
    """

    position: Array
    velocity: Array
    spin: Array


def errors(pairs: Pairs, law: BallLaw) -> Errors:
    """Distances in three dimensions of what is predicted and what was recorded."""
    arrived, rebounded = predict(pairs, law)
    return Errors(
        *(
            np.asarray(np.linalg.norm(guess[:, part] - pairs.end[:, part], axis=1))
            for guess, part in ((arrived, POSITION), (rebounded, VELOCITY), (rebounded, SPIN))
        )
    )
