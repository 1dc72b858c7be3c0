"""The noise floor of recorded events: what errors their own states make of predictions by a perfect law.

In a short flight the air has hardly begun to act, and what is missed is the recordings': a position's error
and a velocity's times the duration. Both are estimated there and carried on to the flights that are judged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from msrd_ros.studies.ball.law import BallLaw
from msrd_ros.studies.ball.pairs import Pairs, predict
from msrd_ros.table_tennis.ball.flight import POSITION

Array = NDArray[np.float64]

SHORT_S = 0.2
_MEDIAN_OF_SQUARE = 0.4549
"""Of a squared standard normal number."""
_ROUNDS = 50
_DRAWS = 200
_SEED = 0


class NoiseFloor(NamedTuple):
    """Errors of recorded states, one axis, standard deviations.

    Attributes
    ----------
    position_m, velocity_m_s
        Of the states that pairs begin with.
    spin_rad_s
        From the spin about the table's normal, which a flight and a rebound leave nearly alone; of start and
        end together.
    short_pairs
        How many short flights it was found from.
    """

    position_m: float
    velocity_m_s: float
    spin_rad_s: float
    short_pairs: int

    def positions_of(self, pairs: Pairs) -> Array:
        """Errors in m that a perfect law would make, many draws a pair, shape (draws * N,)."""
        sd = np.sqrt(self.position_m**2 + (self.velocity_m_s * pairs.duration_s) ** 2)
        directions = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(pairs), 3))
        return np.asarray((np.linalg.norm(directions, axis=2) * sd).ravel())

    def velocities(self) -> Array:
        """Errors in m/s of a rebound predicted perfectly: the start's and the end's together."""
        return np.asarray(np.sqrt(2.0) * self.velocity_m_s * _distances())

    def spins(self) -> Array:
        """The same in rad/s."""
        return self.spin_rad_s * _distances()


def noise_floor(pairs: Pairs, law: BallLaw) -> NoiseFloor | None:
    """Noise of the states that pairs begin with; None if too few flights are short."""
    short = pairs.part(pairs.duration_s < SHORT_S)
    if len(short) < 30:
        return None
    miss = (predict(short, law)[0] - short.end)[:, POSITION]
    times = np.repeat(short.duration_s, 3)
    squares = (miss**2).ravel() / _MEDIAN_OF_SQUARE
    position, velocity = _median_line(times**2, squares)
    turning = pairs.end[:, 8] - pairs.start[:, 8]
    turning = turning[np.isfinite(turning)]
    spin = float(np.sqrt(np.median(turning**2) / _MEDIAN_OF_SQUARE))
    return NoiseFloor(float(np.sqrt(position)), float(np.sqrt(velocity)), spin, len(short))


def _median_line(times: Array, squares: Array) -> tuple[float, float]:
    """Offset and slope, neither negative, of the median of squares over squared times."""
    design = np.stack([np.ones_like(times), times], axis=1)
    weight: Array = np.ones_like(times)
    line: Array = np.zeros(2)
    for _ in range(_ROUNDS):
        # Least absolute deviations by least squares with weights again and again.
        line = np.asarray(nnls(design * weight[:, None], squares * weight)[0])
        weight = np.asarray(np.maximum(np.abs(squares - design @ line), 1e-9) ** -0.5)
    return float(line[0]), float(line[1])


def _distances() -> Array:
    draws = np.random.default_rng(_SEED).standard_normal((20000, 3))
    return np.asarray(np.linalg.norm(draws, axis=1))
