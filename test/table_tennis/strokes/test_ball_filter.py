"""The estimate of a flight that a policy may see instead of the camera's samples."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.ball_filter import BallFilter

pytestmark = pytest.mark.slow

TICK_NS = 20_000_000


def test_it_looks_through_noise_and_latency_until_the_hit() -> None:
    launch = Feeder().nominal(Side.BACKHAND).state()
    path = ball_path(launch, 0.005, 200, Scene().constants())[:, :3]
    rng = np.random.default_rng(0)
    sight = BallFilter(0.003)
    errors = []
    for tick in range(1, 45):
        seen = path[4 * tick - 4] + 0.003 * rng.standard_normal(3)
        position, stamp_ns = sight.see(tick * TICK_NS, (tick - 1) * TICK_NS, seen)
        if tick > 20:
            errors.append(np.linalg.norm(position - path[4 * tick]))
            assert stamp_ns == tick * TICK_NS
    assert max(errors) < 0.01
    away = path[180] + np.array([0.4, 0.0, 0.1])
    position, stamp_ns = sight.see(46 * TICK_NS, 45 * TICK_NS, away)
    assert np.array_equal(position, away)
    assert stamp_ns == 45 * TICK_NS
