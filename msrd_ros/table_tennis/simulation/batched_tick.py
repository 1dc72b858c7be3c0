"""One control tick of one kinematic rally, compiled: the arm follows its command exactly, the ball flies.

The command is shaped by the same scalar law as every other command (`limits.next_velocity`), the
ball moves by the same step as in Bullet (`step_ball`). What is left out is the arm's dynamics.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import place_moving_paddle, place_paddle
from msrd_ros.robots.limits import next_velocity
from msrd_ros.table_tennis.ball.referee import IN_PLAY
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE

Array = NDArray[np.float64]

BALL_STEP_S = 0.005
"""Step of ball and paddle. Contacts are found inside it, and the paddle moves on a cubic through its poses:
its error, jerk / 8 * step^2 in velocity, stays below 5 mm/s at the arm's limits."""
_PADDLE_REACH_M = 0.6
"""A paddle further from the ball than this at a tick cannot meet it within the tick's 20 ms at 25 m/s."""


@njit(cache=True, nogil=True)
def advance_rally(
    arm: Arm,
    position: Array,
    velocity: Array,
    action: Array,
    ball: Array,
    referee: NDArray[np.void],
    time: float,
    period: float,
    scene: NDArray[np.void],
) -> None:
    """Move one rally by one control period, in place.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    position, velocity
        Commanded state of the joints, which the arm is in, shape (N,); rad, rad/s.
    action
        Joint velocities asked for as fractions of the limits, shape (N,).
    ball, referee, time, scene
        As in `step_ball`.
    period
        Control period, s.
    """
    count, speed = len(arm[0].speed), arm[0].speed
    start_position, start_velocity = position.copy(), velocity.copy()
    for joint in range(count):
        wanted = min(max(action[joint], -1.0), 1.0) * speed[joint]
        velocity[joint] = next_velocity(
            position[joint],
            velocity[joint],
            wanted,
            arm[0].lowest[joint],
            arm[0].highest[joint],
            speed[joint],
            arm[0].acceleration[joint],
            period,
        )
        position[joint] += 0.5 * (start_velocity[joint] + velocity[joint]) * period
    steps = round(period / BALL_STEP_S)
    step = period / steps
    before, after = NO_PADDLE.copy(), NO_PADDLE.copy()
    near = is_near(arm, start_position, ball)
    if not near:
        for index in range(steps):
            step_ball(ball, referee, before, after, time + index * step, step, scene)
        return
    middle_position, middle_velocity = np.empty(count), np.empty(count)
    place_moving_paddle(arm, start_position, start_velocity, before)
    for index in range(steps):
        share = (index + 1) / steps
        for joint in range(count):
            change = share * (velocity[joint] - start_velocity[joint])
            middle_velocity[joint] = start_velocity[joint] + change
            middle_position[joint] = start_position[joint] + share * period * (
                start_velocity[joint] + 0.5 * change
            )
        place_moving_paddle(arm, middle_position, middle_velocity, after)
        step_ball(ball, referee, before, after, time + index * step, step, scene)
        copy_onto(before, after)


@njit(cache=True, nogil=True)
def is_near(arm: Arm, position: Array, ball: Array) -> bool:
    """Whether the paddle may meet the ball within the tick."""
    centre, rotation = np.empty(3), np.empty((3, 3))
    place_paddle(arm, position, centre, rotation)
    distance_squared = 0.0
    for axis in range(3):
        distance_squared += (ball[axis] - centre[axis]) ** 2
    return distance_squared < _PADDLE_REACH_M**2


@njit(cache=True, nogil=True)
def advance_rallies(
    arm: Arm,
    positions: Array,
    velocities: Array,
    actions: Array,
    balls: Array,
    referees: NDArray[np.void],
    time: float,
    period: float,
    scene: NDArray[np.void],
) -> None:
    """`advance_rally` for each of N rallies: arrays of shape (N, ...), in place."""
    for index in range(len(balls)):
        advance_rally(
            arm,
            positions[index],
            velocities[index],
            actions[index],
            balls[index],
            referees[index : index + 1],
            time,
            period,
            scene,
        )


@njit(cache=True, nogil=True)
def fly_on(
    balls: Array,
    referees: NDArray[np.void],
    time: float,
    until: float,
    scene: NDArray[np.void],
) -> None:
    """Let balls (N, 9) that are still in play fly on, past any paddle, until each is decided; in place."""
    nowhere = NO_PADDLE.copy()  # constants are of another type than arrays that change
    for index in range(len(balls)):
        now = time
        while now < until and referees[index].verdict == IN_PLAY:
            step_ball(balls[index], referees[index : index + 1], nowhere, nowhere, now, BALL_STEP_S, scene)
            now += BALL_STEP_S
