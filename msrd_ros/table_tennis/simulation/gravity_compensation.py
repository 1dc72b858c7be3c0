"""Torques of an arm in zero-g that a hand leads by the paddle: one implicit step.

Spring-damper, joint damping and brakes are all stiff against the light wrist (6e-4 kg m^2 about the
handle), so the step is solved for the joint rates at its end: with v' the coming rates,

    M (v' - v) = dt [J^T (K (e - dt J v') + D (t - J v')) - B v' + b],

where e is the hand's lead over the paddle at the end of the step, t its twist, and b the brakes of the joints
that would come out too fast. Stable for any gains; the motors then give what is theirs, within their limits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.dynamics import inverse_dynamics, mass_matrix
from msrd_ros.robots.kinematics import paddle_jacobian
from msrd_ros.robots.velocity_limiter import brake_torques

Array = NDArray[np.float64]


class Grip(NamedTuple):
    """How the hand holds the paddle: gains along the six directions of a twist, and what it can bear.

    `stiffness` and `damping` of shape (6,), N/m or Nm/rad and N s/m or Nm s/rad; limits in N and Nm.
    """

    stiffness: Array
    damping: Array
    force_limit: float
    torque_limit: float


class Floating(NamedTuple):
    """How the arm gives way.

    Damping of each joint (N,) in Nm s, and the shares of the speed limits where brakes begin
    and are fully on.
    """

    damping: Array
    brake_from: float
    brake_full: float


_TOO_FAST = 1.005
"""Share of a speed limit from which the hand gives way, because the brakes alone do not hold the joint."""
_GIVE_WAY = 10
"""How often the hand halves its grip within a step; then it lets go for this step."""


@njit(cache=True, nogil=True)
def _share(x: float, y: float, z: float, most: float) -> float:
    size = math.sqrt(x * x + y * y + z * z)
    return most / size if size > most else 1.0


@njit(cache=True, nogil=True)
def float_step(
    arm: Arm,
    position: Array,
    velocity: Array,
    lead: Array,
    twist: Array,
    grip: Grip,
    floating: Floating,
    step: float,
    motor: Array,
    outside: Array,
) -> None:
    """Write the torques of the coming step: the motors' and those that the hand's wrench makes.

    A hand stronger than the brakes gives way, so that it cannot tear a joint over its speed limit.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    position, velocity
        Of the joints, shape (N,), rad and rad/s.
    lead
        From the paddle to where the hand will be at the end of the step, shape (6,): m, then a turn in rad.
    twist
        Of the hand, shape (6,), m/s and rad/s.
    grip
        Of the hand.
    floating
        The arm's own manners.
    step
        Seconds.
    motor, outside
        Written, shape (N,) each, Nm. The motors' are within the torque limits.
    """
    count, torque_limit = len(arm[0].speed), arm[0].torque
    carry = inverse_dynamics(arm, position, velocity, np.zeros(count))
    for joint in range(count):
        carry[joint] += arm[0].friction[joint] * velocity[joint]
    inertia = mass_matrix(arm, position)
    jacobian = paddle_jacobian(arm, position)
    damping = floating.damping
    force_share = torque_share = 1.0
    coming: Array = velocity.copy()
    mobility: Array = np.empty((count, count))
    brake = np.zeros(count)
    wrench = np.zeros(6)
    for attempt in range(_GIVE_WAY + 1):
        for _ in range(3):
            stiffness = _shared(grip.stiffness, force_share, torque_share)
            resistance = _shared(grip.damping, force_share, torque_share)
            pull = jacobian.T * (step * stiffness + resistance)
            heavy = inertia + step * (pull @ jacobian)
            for joint in range(count):
                heavy[joint, joint] += step * damping[joint]
            inverse = np.linalg.inv(heavy)
            for joint in range(count):
                for other in range(count):
                    mobility[joint, other] = step * inverse[joint, other]
            drive = jacobian.T @ (stiffness * lead + resistance * twist)
            coming = mobility @ (inertia @ velocity / step + drive)
            # A hand at the end of its strength is a hand with a softer grip.
            wrench = _wrench(jacobian @ coming, lead, twist, stiffness, resistance, step)
            force = _share(wrench[0], wrench[1], wrench[2], grip.force_limit)
            torque = _share(wrench[3], wrench[4], wrench[5], grip.torque_limit)
            force_share *= force
            torque_share *= torque
            if force > 0.999 and torque > 0.999:
                break
        brake = brake_torques(arm, coming, mobility, carry, damping, floating.brake_from, floating.brake_full)
        wrench = _wrench(jacobian @ coming, lead, twist, stiffness, resistance, step)
        too_fast = False
        for joint in range(count):
            too_fast |= abs(coming[joint]) > _TOO_FAST * arm[0].speed[joint]
        if not too_fast:
            break
        keep = 0.5 if attempt < _GIVE_WAY - 1 else 0.0
        force_share, torque_share = keep * force_share, keep * torque_share
    force = _share(wrench[0], wrench[1], wrench[2], grip.force_limit)
    torque = _share(wrench[3], wrench[4], wrench[5], grip.torque_limit)
    wrench = _shared(wrench, force, torque)
    copy_onto(outside, jacobian.T @ wrench)
    for joint in range(count):
        wanted = carry[joint] - damping[joint] * coming[joint] + brake[joint]
        motor[joint] = min(max(wanted, -torque_limit[joint]), torque_limit[joint])


@njit(cache=True, nogil=True)
def _shared(gains: Array, force_share: float, torque_share: float) -> Array:
    softer = np.empty(6)
    for axis in range(6):
        softer[axis] = gains[axis] * (force_share if axis < 3 else torque_share)
    return softer


@njit(cache=True, nogil=True)
def _wrench(
    going: Array, lead: Array, twist: Array, stiffness: Array, resistance: Array, step: float
) -> Array:
    """What spring and damper give if the paddle's twist over the step is `going`; all of shape (6,)."""
    wrench = np.empty(6)
    for axis in range(6):
        spring = stiffness[axis] * (lead[axis] - step * going[axis])
        wrench[axis] = spring + resistance[axis] * (twist[axis] - going[axis])
    return wrench
