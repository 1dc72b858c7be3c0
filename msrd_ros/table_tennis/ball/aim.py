"""Feeds that come down where they are told."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.ball.flight import fly
from msrd_ros.table_tennis.ball.scene import Scene

Array = NDArray[np.float64]

_PERIOD_S = 0.005
_ELEVATIONS_RAD = np.radians(np.arange(-10.0, 61.0, 2.0))
_HALVINGS = 25


def aimed_feed(place: tuple[float, float], speed_m_s: float, backspin_rad_s: float) -> Feed:
    """The flattest feed over the net that first bounces at a place of the robot's half.

    Parameters
    ----------
    place
        x and y in m, world frame.
    speed_m_s, backspin_rad_s
        At the launch; negative backspin is topspin.

    Raises
    ------
    UserError
        If no elevation does it; says what to change.
    """
    aim = _Aim(place, speed_m_s, backspin_rad_s)
    misses = [aim.miss_m(elevation) for elevation in _ELEVATIONS_RAD]
    for (low, miss), (high, next_miss) in pairwise(zip(_ELEVATIONS_RAD, misses, strict=True)):
        if miss * next_miss > 0.0:
            continue
        below, above = low, high
        for _ in range(_HALVINGS):
            middle = (below + above) / 2.0
            below, above = (middle, above) if aim.miss_m(middle) * miss > 0.0 else (below, middle)
        if aim.passes_net(above):
            return aim.launch(above)
    raise UserError(
        f"a ball of {speed_m_s:g} m/s with {backspin_rad_s:g} rad/s of backspin cannot pass the net and come "
        f"down at x {place[0]:.2f}, y {place[1]:.2f} m; choose another speed, spin or place"
    )


class _Aim:
    """Launches towards a place, by their elevation; the flight stays in one upright plane."""

    def __init__(self, place: tuple[float, float], speed_m_s: float, backspin_rad_s: float) -> None:
        scene, self._start = Scene(), Feeder().position_m
        self._constants = scene.constants()
        self._height_m, self._net_m = scene.table.height_m + scene.ball.radius_m, scene.net.height_m
        away = np.array(place) - self._start[:2]
        self._distance_m = float(np.hypot(*away))
        self._x, self._y = (away / self._distance_m).tolist()
        self._speed_m_s, self._backspin_rad_s = speed_m_s, backspin_rad_s

    def launch(self, elevation_rad: float) -> Feed:
        level = self._speed_m_s * math.cos(elevation_rad)
        return Feed(
            self._start,
            (level * self._x, level * self._y, self._speed_m_s * math.sin(elevation_rad)),
            (self._backspin_rad_s * self._y, -self._backspin_rad_s * self._x, 0.0),
        )

    def miss_m(self, elevation_rad: float) -> float:
        """How far behind the place the first bounce is; negative before it."""
        before, after = self._path(elevation_rad)[-2:]
        share = (before[2] - self._height_m) / (before[2] - after[2])
        bounce = before[:2] + share * (after[:2] - before[:2])
        return float(np.hypot(*(bounce - self._start[:2]))) - self._distance_m

    def passes_net(self, elevation_rad: float) -> bool:
        """Whether the ball is above the net when it crosses it."""
        path = self._path(elevation_rad)
        crossing = int(np.argmax(path[:, 0] < 0.0))
        return bool(path[max(crossing - 1, 0) : crossing + 1, 2].min() > self._height_m + self._net_m)

    def _path(self, elevation_rad: float) -> Array:
        """Where the ball would fly if nothing were in its way, down to the table's height: (K, 3) in m."""
        ball = self.launch(elevation_rad).state()
        path = [ball[:3].copy()]
        while path[-1][2] >= self._height_m:
            fly(ball, _PERIOD_S, self._constants)
            path.append(ball[:3].copy())
        return np.array(path)
