"""The two ends of the table: one turn leads from either to the other, and the table is the same from both."""

from __future__ import annotations

import math

import numpy as np

from msrd_ros.table_tennis.ball.ends import End, between, turned
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.referee import new_referees
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE
from msrd_ros.table_tennis.strategies.table import Side


def test_a_turn_is_one_by_pi_about_the_vertical_and_its_own_inverse() -> None:
    ball = np.random.default_rng(0).standard_normal((4, 9))
    rotation = np.array(
        [
            [math.cos(math.pi), -math.sin(math.pi), 0.0],
            [math.sin(math.pi), math.cos(math.pi), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    np.testing.assert_allclose(turned(ball).reshape(4, 3, 3), ball.reshape(4, 3, 3) @ rotation.T, atol=1e-12)
    np.testing.assert_array_equal(turned(turned(ball)), ball)


def test_only_the_far_frame_is_turned() -> None:
    place = np.array([0.3, -0.2, 1.0])
    np.testing.assert_array_equal(between(End.NEAR, place), place)
    np.testing.assert_array_equal(between(End.FAR, place), [-0.3, 0.2, 1.0])
    assert End.NEAR.other is End.FAR
    assert End.FAR.other is End.NEAR
    assert (End.NEAR.yaw_rad, End.FAR.yaw_rad) == (0.0, math.pi)


def test_a_ball_flies_and_bounces_alike_from_both_ends() -> None:
    scene = Scene().constants()
    ball = Feeder().nominal(Side.BACKHAND).state()
    other = turned(ball)
    for step in range(900):
        for state in (ball, other):
            step_ball(state, new_referees(1), NO_PADDLE, NO_PADDLE, 0.001 * step, 0.001, scene)
    assert abs(ball[3]) < 2.0, "it has bounced"
    np.testing.assert_allclose(turned(other), ball, atol=1e-12)
