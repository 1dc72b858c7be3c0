"""What is seen of the ball in a simulated world: where it waits, and then what the camera shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.table_tennis.ball.camera import Camera, CameraConfig
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE

EPOCH_NS = NANOSECONDS
"""Simulated time starts at one second: zero means "no time yet" in ROS."""


def simulated_ns(time_s: float) -> int:
    """Simulated time in whole nanoseconds, of whole milliseconds since the start in s."""
    return EPOCH_NS + round(time_s * 1000.0) * (NANOSECONDS // 1000)


class Sample(NamedTuple):
    """One frame of the camera: when it was taken and where the ball seemed to be, shape (3,), m."""

    stamp_ns: int
    position: NDArray[np.float64]


class SeenBall:
    """The newest sample of the ball.

    Parameters
    ----------
    config
        Of the camera.
    seed
        Of its noise.

    Attributes
    ----------
    launch_ns
        When the last ball was launched; 0 before the first.
    """

    def __init__(self, config: CameraConfig, seed: int) -> None:
        self._config, self._seed = config, seed
        self._waiting = np.array(Feeder().nominal(DEFAULT_SIDE).position)
        self._camera = Camera(config, np.random.default_rng(seed))
        self._sample = Sample(EPOCH_NS, self._waiting)
        self.launch_ns = 0

    def change_camera(self, config: CameraConfig) -> None:
        """See the ball better or worse from now on, at the same rate of frames."""
        self._config = config
        self._camera.config = config

    def wait_at(self, place: NDArray[np.float64]) -> bool:
        """Let the next ball wait at `place` (3,), m; whether it did so before, and has been seen there."""
        shown = np.array_equal(self._waiting, place)
        self._waiting = place
        return shown

    def launch(self, time_ns: int, number: int) -> None:
        """The ball that waits sets out, as number so and so.

        The noise depends on the ball alone, so that a rally repeats whatever came before it.
        """
        self._camera = Camera(self._config, np.random.default_rng((self._seed, number)))
        self.launch_ns = time_ns
        self._sample = Sample(time_ns, self._waiting)
        self._camera.offer(0.0, self._waiting)

    def offer(self, since_launch_s: float, position: NDArray[np.float64]) -> None:
        """Show the camera where the ball is, (3,), m; once per simulation step."""
        self._camera.offer(since_launch_s, position)

    def look(self, time_ns: int, in_play: bool) -> Sample:
        """The newest frame that can be read; a ball that waits is seen without noise.

        There is time to average over many frames then.
        """
        if not in_play:
            self._sample = Sample(time_ns, self._waiting)
            return self._sample
        frame = self._camera.newest((time_ns - self.launch_ns) / NANOSECONDS)
        if frame is not None:
            self._sample = Sample(self.launch_ns + round(frame.stamp * NANOSECONDS), frame.position)
        return self._sample
