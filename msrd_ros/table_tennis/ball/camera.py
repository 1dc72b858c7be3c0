"""The camera: the only view of the ball that teachers, policies and learning get."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError

_CLOCK_TOLERANCE_S = 1e-9
"""Times are sums of steps; what is nearer than this is the same moment."""


@dataclass(frozen=True)
class CameraConfig:
    """How well the camera sees.

    Parameters
    ----------
    rate_hz
        Frames a second; frame k is taken at k / rate_hz.
    noise_std_m
        Standard deviation of a frame's error along each axis.
    latency_s
        From the capture of a frame until it can be read.
    dropout
        Probability that a frame shows no ball.

    Raises
    ------
    UserError
        If a value is out of range; the message names it.
    """

    rate_hz: float = 200.0
    noise_std_m: float = 0.001
    latency_s: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz <= 10_000.0:
            raise UserError(f"camera: rate_hz is {self.rate_hz}; give 0 < rate_hz <= 10000")
        if not 0.0 <= self.noise_std_m < math.inf:
            raise UserError(f"camera: noise_std_m is {self.noise_std_m}; give 0 or more")
        if not 0.0 <= self.latency_s < math.inf:
            raise UserError(f"camera: latency_s is {self.latency_s}; give 0 or more")
        if not 0.0 <= self.dropout < 1.0:
            raise UserError(f"camera: dropout is {self.dropout}; give 0 <= dropout < 1")


class BallSample(NamedTuple):
    """One frame: when it was taken (s) and where the ball seemed to be (m), shape (3,)."""

    stamp: float
    position: NDArray[np.float64]


class Camera:
    """Takes frames of a ball whose true positions it is offered as the simulation moves on.

    Every frame draws the same number of random numbers, whether it is lost or not, so that changing one
    setting leaves the other draws of a seed in place.

    Parameters
    ----------
    config
        Rate, noise, latency and dropout.
    rng
        Where the noise comes from.
    """

    def __init__(self, config: CameraConfig, rng: np.random.Generator) -> None:
        self.config = config
        self._rng = rng
        self.restart()

    def restart(self, time: float = 0.0) -> None:
        """Forget all frames; the next one is the first whose moment is not before `time`."""
        self._frame = math.ceil((time - _CLOCK_TOLERANCE_S) * self.config.rate_hz)
        self._last: tuple[float, NDArray[np.float64]] | None = None
        self._in_transit: deque[BallSample] = deque()
        self._newest: BallSample | None = None

    def offer(self, time: float, position: NDArray[np.float64]) -> None:
        """Show the ball at a moment; frames due since the moment offered before lie on the line between.

        Parameters
        ----------
        time
            Seconds, not before the moment offered before.
        position
            True position of the ball's centre, m, shape (3,).
        """
        here = np.array(position, dtype=np.float64)
        if self._last is None:
            # Frames of the time before the ball came into view were never taken.
            self._frame = max(self._frame, math.ceil((time - _CLOCK_TOLERANCE_S) * self.config.rate_hz))
            self._last = (time, here)
        before, there = self._last
        while (stamp := self._frame / self.config.rate_hz) <= time + _CLOCK_TOLERANCE_S:
            span = time - before
            share = min((stamp - before) / span, 1.0) if span > 0.0 else 1.0
            self._take(stamp, there + share * (here - there))
            self._frame += 1
        self._last = (time, here)

    def newest(self, time: float) -> BallSample | None:
        """The newest frame that can be read at `time`, or None if there is none yet."""
        while self._in_transit and self._arrival(self._in_transit[0]) <= time + _CLOCK_TOLERANCE_S:
            self._newest = self._in_transit.popleft()
        return self._newest

    def _arrival(self, sample: BallSample) -> float:
        return sample.stamp + self.config.latency_s

    def _take(self, stamp: float, position: NDArray[np.float64]) -> None:
        error = self._rng.standard_normal(3) * self.config.noise_std_m
        lost = self._rng.random() < self.config.dropout
        if not lost:
            self._in_transit.append(BallSample(stamp, position + error))
