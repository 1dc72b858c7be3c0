"""What a policy may see of the ball instead of raw samples: an estimate of where it is now.

Raw samples are late by the camera's latency, and their differences are useless when they are noisy and
rare. Until the hit a ball keeps to the model of flight, so its launch is fitted to all samples so far and
flown to the present moment; after the hit, samples are passed on as they come.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.table_tennis.ball.estimator import PATH_PERIOD_S, EstimatorConfig, FlightEstimator
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import path_at
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE
from msrd_ros.table_tennis.teachers.side import feed_path

LEAST_MISFIT_M = 0.05
MISFIT_DEVIATIONS = 8.0
"""A sample that lies further off the estimated flight, in metres or in deviations, belongs to a ball that
was touched."""


class BallFilter:
    """Watches one ball from its launch to the end of its rally.

    Parameters
    ----------
    noise_m
        Standard deviation of the camera's samples that is reckoned with, m.
    """

    def __init__(self, noise_m: float) -> None:
        noise_m = max(noise_m, 0.001)
        self._estimator = FlightEstimator(
            Scene().constants(), EstimatorConfig(sample_sd_m=noise_m, first_fit=5, path_rows=400)
        )
        self._limit_m = max(LEAST_MISFIT_M, MISFIT_DEVIATIONS * noise_m)
        self._path: NDArray[np.float64] | None = None
        self._touched = False

    @classmethod
    def compile_ahead(cls) -> None:
        """Watch a made-up ball, so that nothing has to be compiled while a real one is flying."""
        ball_filter = cls(0.001)
        for index, row in enumerate(feed_path(Feeder().nominal(DEFAULT_SIDE), Scene().constants())[:20]):
            stamp_ns = round(index * PATH_PERIOD_S * NANOSECONDS)
            ball_filter.see(stamp_ns, stamp_ns, row[:3])

    def see(
        self, now_ns: int, stamp_ns: int, position: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], int]:
        """Take in the newest sample; where the ball is, and of when that is.

        Parameters
        ----------
        now_ns
            Present moment; same clock as the stamps.
        stamp_ns
            When the frame was taken.
        position
            Where the ball seemed to be, shape (3,), m.

        Returns
        -------
        position
            Estimate for the present moment, or the sample itself while there is none.
        stamp_ns
            The moment that it is of.
        """
        if self._touched:
            return position, stamp_ns
        stamp_s = stamp_ns / NANOSECONDS
        if self._path is not None and np.linalg.norm(position - self._at(stamp_s)) > self._limit_m:
            self._touched = True
            # The estimate was ahead of the camera: its first sample afterwards may be older.
            return position, stamp_ns
        if self._estimator.see(stamp_s, position):
            self._path = self._estimator.path()
        if self._path is None:
            return position, stamp_ns
        return self._at(now_ns / NANOSECONDS), now_ns

    def _at(self, time_s: float) -> NDArray[np.float64]:
        assert self._path is not None
        assert self._estimator.first_seen_s is not None
        return path_at(self._path, PATH_PERIOD_S, time_s - self._estimator.first_seen_s)[:3].copy()
