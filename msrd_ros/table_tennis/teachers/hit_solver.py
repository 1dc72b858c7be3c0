"""Finds a hit: when to meet the ball, in which posture and with which joint rates, for a wanted return.

Unknowns are the time of the hit, the N joint angles and the N joint rates, 1 + 2 N in all. Conditions come as
weighted residuals of the same rubber and flight model that the rally plays by: the blade's face touches the
ball at its centre, the ball leaves with the wanted spin for the wanted place over the net, the rates stay
within a share of the limits; what freedom is left goes to small rates, a steady blade and a familiar posture.
A compiled Levenberg-Marquardt search solves it in about a millisecond from a good start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.table_tennis.ball.rebound import rebound_rubber
from msrd_ros.table_tennis.ball.trajectory import path_at, return_flight

Array = NDArray[np.float64]

TIME = 0
"""Layout of the unknowns: time in s, joint angles in rad, joint rates as fractions of the speed limits."""

# What a residual of 1 stands for. The first group decides whether the ball comes back as wanted.
_CENTRING_M = 0.004
_SPIN_RAD_S = 4.0
_SIDE_SPIN_RAD_S = 30.0
_LANDING_DEPTH_M = 0.1
_LANDING_WIDTH_M = 0.2
_CLEARANCE_M = 0.03
_APEX_M = 0.1
_APPROACH_M_S = 0.1
# Limits, and then what is only preferred.
_RATE_EXCESS = 0.01
_ANGLE_EXCESS_RAD = 0.02
_HEIGHT_EXCESS_M = 0.01
_RATE_EFFORT = 3.5
_BLADE_TURN_RAD_S = 10.0

LOWEST_OVER_NET_M = 0.13
"""Least room between the ball's underside and the net's top."""
HIGHEST_APEX_M = 1.60
SLOWEST_APPROACH_M_S = 1.5
BLADE_OVER_TABLE_M = 0.04

_SCALAR_RESIDUALS, _RESIDUALS_A_JOINT = 16, 5


def hit_size(joints: int) -> int:
    """How many unknowns a hit of an arm with so many joints has."""
    return 1 + 2 * joints


def angles_of(hit: Array) -> Array:
    """Joint angles (N,) in rad of a hit; a view."""
    return hit[1 : 1 + len(hit) // 2]


def rates_of(hit: Array) -> Array:
    """Joint rates (N,) of a hit as fractions of the speed limits; a view."""
    return hit[1 + len(hit) // 2 :]


def hit_of(time_s: float, position: Array, velocity: Array, speed_rad_s: Array) -> Array:
    """A hit (1 + 2 N,) from joint angles (N,) in rad and rates (N,) in rad/s; speed limits (N,)."""
    return np.concatenate([[time_s], position, velocity / speed_rad_s])


class HitWish(NamedTuple):
    """What is wanted of a hit.

    Attributes
    ----------
    face
        +1 for the forehand face (+y of the paddle), -1 for the backhand face.
    spin_y
        Spin about y right after the hit, rad/s.
    landing_x, landing_y
        Where the ball shall bounce on the far half, m.
    time, time_slack
        The hit comes within `time` +- `time_slack`, s.
    highest_rate
        Largest joint rate as a fraction of the speed limits.
    posture, posture_weight
        Joint angles (N,) to stay near to, and residual per rad.
    rates, rates_weight
        Joint rates (N,) as fractions of the limits to stay near to, and residual per fraction.
    lower, upper
        Joint angles (N,) between which the hit is wanted, rad.
    lowest_apex, highest_apex
        Between which heights the top of the return is wanted, m.
    """

    face: float
    spin_y: float
    landing_x: float
    landing_y: float
    time: float
    time_slack: float
    highest_rate: float
    posture: Array
    posture_weight: float
    rates: Array
    rates_weight: float
    lower: Array
    upper: Array
    lowest_apex: float = 0.0
    highest_apex: float = HIGHEST_APEX_M


class Hit(NamedTuple):
    """What a hit does. Positions m, velocities m/s, world frame.

    Attributes
    ----------
    off_centre
        Ball's centre minus where it would be for a touch in the middle of the face, shape (3,).
    normal
        Outward normal of the face that meets the ball, shape (3,).
    paddle_velocity, paddle_turn
        Velocity of the face where it touches, and angular velocity of the paddle, shape (3,).
    approach
        Speed along the normal at which ball and face close, positive.
    ball_in, ball_out
        Ball before and after, shape (9,).
    """

    off_centre: Array
    normal: Array
    paddle_velocity: Array
    paddle_turn: Array
    approach: float
    ball_in: Array
    ball_out: Array


@njit(cache=True, nogil=True)
def carry_out(arm: Arm, hit: Array, face: float, path: Array, period: float, scene: NDArray[np.void]) -> Hit:
    """What the hit (1 + 2 N,) does to the ball on `path` (T, 9; rows `period` s apart)."""
    constants = scene[0]
    ball = path_at(path, period, hit[0])
    count = len(arm[0].speed)
    joints, rates = hit[1 : 1 + count], hit[1 + count : 1 + 2 * count] * arm[0].speed
    centre, rotation = paddle_pose(arm, joints)
    twist = paddle_jacobian(arm, joints) @ rates
    normal = face * rotation[:, 1]
    lever = constants.blade_half_thickness * normal
    turn = twist[3:6].copy()
    velocity = np.empty(3)
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        velocity[axis] = twist[axis] + (turn[one] * lever[other] - turn[other] * lever[one])
    off_centre = ball[:3] - centre - normal * (constants.ball_radius + constants.blade_half_thickness)
    approach = -np.sum((ball[3:6] - velocity) * normal)
    struck = ball.copy()
    rebound_rubber(
        struck,
        normal[0],
        normal[1],
        normal[2],
        velocity[0],
        velocity[1],
        velocity[2],
        constants,
    )
    return Hit(off_centre, normal, velocity, turn, approach, ball, struck)


@njit(cache=True, nogil=True)
def _excess(value: float, lower: float, upper: float) -> float:
    return max(value - upper, 0.0) + min(value - lower, 0.0)


@njit(cache=True, nogil=True)
def hit_residuals(
    arm: Arm, hit: Array, wish: HitWish, path: Array, period: float, scene: NDArray[np.void], out: Array
) -> int:
    """Write the weighted residuals of a hit (1 + 2 N,) into `out` and return how many there are."""
    constants = scene[0]
    done = carry_out(arm, hit, wish.face, path, period, scene)
    flight = return_flight(done.ball_out, scene)
    for axis in range(3):
        out[axis] = done.off_centre[axis] / _CENTRING_M
    out[3] = (done.ball_out[7] - wish.spin_y) / _SPIN_RAD_S
    out[4] = done.ball_out[6] / _SIDE_SPIN_RAD_S
    out[5] = done.ball_out[8] / _SIDE_SPIN_RAD_S
    out[6] = (flight.landing_x - wish.landing_x) / _LANDING_DEPTH_M
    out[7] = (flight.landing_y - wish.landing_y) / _LANDING_WIDTH_M
    lowest = constants.net_top + constants.ball_radius + LOWEST_OVER_NET_M
    # A ball that never gets over the net line is judged by its landing alone, which is smooth.
    out[8] = max(lowest - flight.net_height, 0.0) / _CLEARANCE_M if flight.landing_x > 0.0 else 0.0
    out[9] = _excess(flight.apex, wish.lowest_apex, wish.highest_apex) / _APEX_M
    out[10] = max(SLOWEST_APPROACH_M_S - done.approach, 0.0) / _APPROACH_M_S
    out[11] = _excess(hit[0] - wish.time, -wish.time_slack, wish.time_slack) / _CENTRING_M
    upright = np.sqrt(max(1.0 - done.normal[2] ** 2, 0.0))
    lower_edge = done.ball_in[2] - constants.ball_radius * done.normal[2] - constants.blade_radius * upright
    out[12] = _excess(lower_edge, constants.table_top + BLADE_OVER_TABLE_M, np.inf) / _HEIGHT_EXCESS_M
    along = np.sum(done.paddle_turn * done.normal)
    for axis in range(3):
        out[13 + axis] = (done.paddle_turn[axis] - along * done.normal[axis]) / _BLADE_TURN_RAD_S
    count, place = len(arm[0].speed), _SCALAR_RESIDUALS
    for joint in range(count):
        angle, rate = hit[1 + joint], hit[1 + count + joint]
        out[place] = _excess(rate, -wish.highest_rate, wish.highest_rate) / _RATE_EXCESS
        out[place + 1] = rate / _RATE_EFFORT
        out[place + 2] = _excess(angle, wish.lower[joint], wish.upper[joint]) / _ANGLE_EXCESS_RAD
        out[place + 3] = (angle - wish.posture[joint]) * wish.posture_weight
        out[place + 4] = (rate - wish.rates[joint]) * wish.rates_weight
        place += _RESIDUALS_A_JOINT
    return place


@njit(cache=True, nogil=True)
def solve_hit(
    arm: Arm, start: Array, wish: HitWish, path: Array, period: float, scene: NDArray[np.void], steps: int
) -> tuple[Array, float]:
    """Best hit found from `start` (1 + 2 N,), and its cost (half the sum of squared residuals).

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    wish
        What is wanted.
    path, period
        Path of the ball from its launch, rows `period` s apart, shape (T, 9).
    steps
        Most Levenberg-Marquardt steps.
    """
    hit = start.copy()
    unknowns = len(start)
    most = _SCALAR_RESIDUALS + _RESIDUALS_A_JOINT * len(arm[0].speed)
    residuals, probe = np.empty(most), np.empty(most)
    count = hit_residuals(arm, hit, wish, path, period, scene, residuals)
    cost = 0.5 * np.sum(residuals[:count] ** 2)
    slopes = np.empty((count, unknowns))
    damping = 1e-3
    for _ in range(steps):
        for unknown in range(unknowns):
            nudge = 1e-6
            moved = hit.copy()
            moved[unknown] += nudge
            hit_residuals(arm, moved, wish, path, period, scene, probe)
            for row in range(count):
                slopes[row, unknown] = (probe[row] - residuals[row]) / nudge
        gradient = slopes.T @ residuals[:count]
        curvature = slopes.T @ slopes
        before = cost
        for _ in range(8):
            damped = curvature.copy()
            for unknown in range(unknowns):
                damped[unknown, unknown] += damping * (curvature[unknown, unknown] + 1e-6)
            moved = hit - np.linalg.solve(damped, gradient)
            hit_residuals(arm, moved, wish, path, period, scene, probe)
            attempt = 0.5 * np.sum(probe[:count] ** 2)
            if attempt < cost:
                hit, cost = moved, attempt
                copy_onto(residuals[:count], probe)
                damping = max(damping * 0.2, 1e-9)
                break
            damping *= 5.0
        if before - cost <= 1e-6 * before + 1e-9:
            break
    return hit, cost
