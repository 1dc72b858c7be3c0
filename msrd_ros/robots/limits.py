"""The one place where a wanted joint velocity becomes a safe command.

A command is the state that the joints shall have one control period later: positions ``q'`` and
velocities ``v'``, reached at constant acceleration,

    v' = v + clip(wanted - v, -a T, +a T),      q' = q + (v + v') T / 2,

with the speed limited so that a joint can always stop before its position limit. The executor, the
in-process rollouts and the batched simulator all go through `shape_command`; the commanded state, not
the measured one, is carried forward, so that tracking errors do not build up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit, vectorize
from msrd_ros.core.errors import UserError
from msrd_ros.robots.robot import Robot


@njit(cache=True)
def next_velocity(
    position: float,
    velocity: float,
    wanted: float,
    lower: float,
    upper: float,
    speed_limit: float,
    acceleration_limit: float,
    period: float,
) -> float:
    """Velocity of one joint after one control period (rad/s).

    Of all velocities that the acceleration limit lets the joint reach, the one nearest to `wanted` from
    which it can still stop before `lower` and `upper` (rad).
    """
    change = acceleration_limit * period
    half = 0.5 * period
    # Stopping from v' takes v'^2 / (2 a); v' is reached after moving (v + v') T / 2. Solved for v'.
    room_up = max(upper - position - velocity * half, 0.0)
    room_down = max(position + velocity * half - lower, 0.0)
    fastest_up = acceleration_limit * (math.sqrt(half * half + 2.0 * room_up / acceleration_limit) - half)
    fastest_down = acceleration_limit * (math.sqrt(half * half + 2.0 * room_down / acceleration_limit) - half)
    target = min(max(wanted, -speed_limit), speed_limit)
    target = min(max(target, -fastest_down), fastest_up)
    return min(max(target, velocity - change), velocity + change)


_next_velocities = vectorize(["float64(" + ", ".join(["float64"] * 8) + ")"], cache=True)(
    next_velocity.py_func
)


class JointReference(NamedTuple):
    """Commanded state of the joints: position (..., N) in rad and velocity (..., N) in rad/s."""

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


def shape_command(
    robot: Robot, reference: JointReference, wanted_velocity: NDArray[np.float64], period_s: float
) -> JointReference:
    """Next commanded state within speed, acceleration and position limits.

    Parameters
    ----------
    robot
        Whose limits hold; N joints.
    reference
        The commanded state so far, shape (..., N).
    wanted_velocity
        Joint velocity asked for, rad/s, shape (..., N). Infinite and huge values are limited like any
        other; NaN is refused.
    period_s
        Control period in seconds.

    Raises
    ------
    UserError
        If a wanted velocity is not a number; the message names the joint.
    """
    missing = np.isnan(wanted_velocity)
    if missing.any():
        joint = robot.joint_names[int(np.argwhere(missing)[0][-1])]
        raise UserError(f"velocity wanted of joint {joint} is not a number; the policy's output is unusable")
    limits = robot.limits
    velocity = _next_velocities(
        reference.position,
        reference.velocity,
        wanted_velocity,
        limits.lowest_rad,
        limits.highest_rad,
        limits.speed_rad_s,
        limits.acceleration_rad_s2,
        period_s,
    )
    position = reference.position + 0.5 * (reference.velocity + velocity) * period_s
    return JointReference(position, velocity)


def velocity_towards(
    robot: Robot,
    reference: JointReference,
    goal: NDArray[np.float64],
    period_s: float,
    speed_fraction: float = 0.5,
) -> NDArray[np.float64]:
    """Joint velocity (..., N) in rad/s that leads the reference to `goal` and comes to rest there.

    The square-root profile of a joint that brakes at half its acceleration limit, at most
    `speed_fraction` of its speed limit.
    """
    error = goal - reference.position
    braking = np.sqrt(robot.limits.acceleration_rad_s2 * np.abs(error))
    # Within a period's reach the linear law takes over and lands exactly.
    speed = np.minimum(
        np.minimum(braking, robot.limits.speed_rad_s * speed_fraction), np.abs(error) / period_s / 2
    )
    return np.sign(error) * speed
