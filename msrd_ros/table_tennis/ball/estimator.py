"""What a teacher makes of the camera's samples: an estimate of the whole flight, past and to come.

A fed ball's launch state (position, velocity, spin) is fitted to all samples since it was first seen
flying, by Gauss-Newton steps through the model of flight and bounce. The spin cannot be seen; it shows in the
curve of the flight and in the bounce, and whoever knows the feeder expects its usual spin: a prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.flight import BALL_SIZE
from msrd_ros.table_tennis.ball.trajectory import ball_path

Array = NDArray[np.float64]

PATH_PERIOD_S = 0.005
"""Between the rows of an estimated path."""

_MOST_SAMPLES = 600
_FEED_SPEED_M_S = 2.0
_KINK_M_S = 1.0
_NUDGES = np.array([1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2])
"""By which a state is changed to see what that changes."""


@dataclass(frozen=True)
class EstimatorConfig:
    """How a flight is estimated.

    Attributes
    ----------
    sample_sd_m
        Standard deviation of a sample's error that is reckoned with.
    backspin_rad_s, backspin_sd_rad_s
        Spin across the flight that feeds are known to have; positive is backspin.
    side_spin_sd_rad_s
        Standard deviation of the two other components, expected to be zero.
    first_fit
        Samples needed for the first estimate.
    path_rows
        Length of the path, in periods of 5 ms from the first sample on.
    """

    sample_sd_m: float = 0.002
    backspin_rad_s: float = 60.0
    backspin_sd_rad_s: float = 20.0
    side_spin_sd_rad_s: float = 5.0
    first_fit: int = 8
    path_rows: int = 260


@njit(cache=True, nogil=True)
def _predict(
    ball: Array, times: Array, scene: NDArray[np.void], out: Array, usable: NDArray[np.bool_]
) -> None:
    """Positions (N, 3) of a ball at increasing times; samples beside a bounce are not usable."""
    rows = int(times[-1] / PATH_PERIOD_S) + 2
    path = ball_path(ball, PATH_PERIOD_S, rows, scene)
    for sample in range(len(times)):
        place = times[sample] / PATH_PERIOD_S
        index = min(int(place), rows - 2)
        share = place - index
        before, after = path[index], path[index + 1]
        # A straight line between two rows is wrong by no more than 31 micrometres, except over a bounce.
        if abs(after[5] - before[5]) > _KINK_M_S:
            usable[sample] = False
        for axis in range(3):
            out[sample, axis] = before[axis] + share * (after[axis] - before[axis])


@njit(cache=True, nogil=True)
def fit_flight(
    start: Array,
    times: Array,
    positions: Array,
    expected: Array,
    weights: Array,
    sample_sd: float,
    steps: int,
    scene: NDArray[np.void],
) -> tuple[Array, Array]:
    """State (9,) of a ball at time 0 that fits samples and expectations best, and its covariance (9, 9).

    The covariance is that of a linear fit about it: of what samples and expectations leave open if the
    law of flight and rebound is right.

    Parameters
    ----------
    start
        First guess (9,).
    times, positions
        Samples, shape (N,) in s, increasing, and (N, 3) in m.
    expected, weights
        Prior mean (9,) and its inverse standard deviations (9,); 0 where nothing is expected.
    sample_sd
        Of a sample's error, m.
    steps
        Gauss-Newton steps.
    """
    count = len(times)
    ball = start.copy()
    nudges = _NUDGES
    here, there = np.empty((count, 3)), np.empty((count, 3))
    slopes = np.empty((3 * count, BALL_SIZE))
    curvature = np.eye(BALL_SIZE)
    for _ in range(steps):
        usable = np.ones(count, dtype=np.bool_)
        _predict(ball, times, scene, here, usable)
        for unknown in range(BALL_SIZE):
            moved = ball.copy()
            moved[unknown] += nudges[unknown]
            _predict(moved, times, scene, there, usable)
            for sample in range(count):
                for axis in range(3):
                    change = there[sample, axis] - here[sample, axis]
                    slopes[3 * sample + axis, unknown] = change / (nudges[unknown] * sample_sd)
        misfit = ((positions - here) / sample_sd).ravel()
        for sample in range(count):
            if not usable[sample]:
                slopes[3 * sample : 3 * sample + 3] = 0.0
        curvature = slopes.T @ slopes
        gradient = slopes.T @ misfit + weights * weights * (expected - ball)
        for unknown in range(BALL_SIZE):
            curvature[unknown, unknown] += weights[unknown] ** 2 + 1e-9
        ball += np.linalg.solve(curvature, gradient)
    return ball, np.linalg.inv(curvature).astype(np.float64)


class FlightEstimator:
    """Watches one feed after the other.

    Parameters
    ----------
    scene
        `Scene.constants()`: how balls fly and bounce, as experience has taught.
    config
        How to estimate.
    """

    def __init__(self, scene: NDArray[np.void], config: EstimatorConfig | None = None) -> None:
        self.config = config or EstimatorConfig()
        self._scene = scene
        self._times = np.empty(_MOST_SAMPLES)
        self._positions = np.empty((_MOST_SAMPLES, 3))
        self.forget()

    def forget(self) -> None:
        """Wait for another ball."""
        self._count = 0
        self._before: tuple[float, Array] | None = None
        self._launch: Array | None = None
        self._covariance: Array | None = None
        self.first_seen_s: float | None = None

    @property
    def samples(self) -> int:
        """Samples of the flight under way."""
        return self._count

    def see(self, stamp_s: float, position: Array) -> bool:
        """Take in the newest sample; returns whether it is new and of a flying ball.

        The flight begins with the first sample on the far half that comes towards the robot faster than
        2 m/s. A sample with an old stamp changes nothing.

        Parameters
        ----------
        stamp_s
            When the frame was taken, s; any clock.
        position
            Where the ball seemed to be, shape (3,), m.
        """
        if self._before is not None and stamp_s <= self._before[0]:
            return False
        before, self._before = self._before, (stamp_s, np.array(position, dtype=np.float64))
        if self.first_seen_s is None:
            if before is None or position[0] <= 0.0:
                return False
            if position[0] - before[1][0] > -_FEED_SPEED_M_S * (stamp_s - before[0]):
                return False
            self.first_seen_s = stamp_s
        if self._count >= _MOST_SAMPLES:
            return False
        self._times[self._count] = stamp_s - self.first_seen_s
        self._positions[self._count] = position
        self._count += 1
        return True

    def estimate(self, steps: int = 2) -> Array | None:
        """State (9,) of the ball when it was first seen, from all samples; None if they are too few."""
        if self._count < self.config.first_fit:
            return None
        times, positions = self._times[: self._count], self._positions[: self._count]
        if self._launch is None:
            self._launch = self._first_guess(times, positions)
            steps += 2
        config = self.config
        heading = self._launch[3:5] / (math.hypot(self._launch[3], self._launch[4]) + 1e-9)
        expected, weights = np.zeros(BALL_SIZE), np.zeros(BALL_SIZE)
        # Topspin turns about z x heading.
        expected[6:8] = config.backspin_rad_s * np.array([heading[1], -heading[0]])
        weights[6:] = 1.0 / config.side_spin_sd_rad_s
        weights[7] = 1.0 / config.backspin_sd_rad_s
        self._launch, self._covariance = fit_flight(
            self._launch, times, positions, expected, weights, config.sample_sd_m, steps, self._scene
        )
        return self._launch

    def path(self) -> Array | None:
        """Estimated path from the first sample on, shape (path_rows, 9), rows 5 ms apart."""
        launch = self.estimate()
        if launch is None or not np.isfinite(launch).all():
            return None
        return ball_path(launch, PATH_PERIOD_S, self.config.path_rows, self._scene)

    def position_sd(self, time_s: float) -> Array | None:
        """How sure the last estimate is of where the ball is at a time since the first sample.

        Parameters
        ----------
        time_s
            Past or to come, s.

        Returns
        -------
        Array or None
            Standard deviations (3,) in m that camera noise and unknown spin leave, along the world's axes; an
            error of the law of flight is not in them. None before the first estimate.
        """
        if self._launch is None or self._covariance is None:
            return None
        times = np.array([time_s])
        here, there, usable = np.empty((1, 3)), np.empty((1, 3)), np.ones(1, dtype=np.bool_)
        _predict(self._launch, times, self._scene, here, usable)
        slopes = np.empty((3, BALL_SIZE))
        for unknown in range(BALL_SIZE):
            moved = self._launch.copy()
            moved[unknown] += _NUDGES[unknown]
            _predict(moved, times, self._scene, there, usable)
            slopes[:, unknown] = (there - here)[0] / _NUDGES[unknown]
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slopes, self._covariance, slopes)))

    def _first_guess(self, times: Array, positions: Array) -> Array:
        """Straight line with gravity through the samples."""
        fallen = positions.copy()
        fallen[:, 2] += 0.5 * self._scene["gravity"][0] * times**2
        slope, offset = np.polyfit(times, fallen, 1)
        return np.concatenate([offset, slope, np.zeros(3)])
