"""Brakes of the joints: hold joints that would get too fast, with what their motors have left."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm

Array = NDArray[np.float64]

_SWEEPS = 40
_SETTLED_NM = 1e-6


@njit(cache=True, nogil=True)
def brake_torques(
    arm: Arm,
    coming: Array,
    mobility: Array,
    motor: Array,
    damping: Array,
    brake_from: float,
    brake_full: float,
) -> Array:
    """Brake torques (N,) in Nm for the coming step, solved implicitly for all joints together.

    Every brake is viscous, from nothing at `brake_from` of its joint's speed limit to the joint's whole
    torque at `brake_full`. Solved by projected Gauss-Seidel, it is stable however stiff it is.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    coming
        Joint rates at the end of the step without brakes, shape (N,), rad/s; changed to those with them.
    mobility
        Change of the rates by torques over the step, shape (N, N).
    motor, damping
        Torques of the motors at rates of zero (Nm), and how they fall with the rates (Nm s), shape (N,).
    brake_from, brake_full
        Shares of the speed limits.
    """
    count, speed_limit, torque_limit = len(arm[0].speed), arm[0].speed, arm[0].torque
    brake = np.zeros(count)
    for _ in range(_SWEEPS):
        largest = 0.0
        for joint in range(count):
            own = mobility[joint, joint]
            soft = brake_from * speed_limit[joint]
            slope = torque_limit[joint] / ((brake_full - brake_from) * speed_limit[joint])
            free = coming[joint] - own * brake[joint]
            excess = max(abs(free) - soft, 0.0)
            wanted = -math.copysign(slope * excess / (1.0 + slope * own), free)
            # What the motor has left beside its other work.
            busy = motor[joint] - damping[joint] * coming[joint]
            limit = torque_limit[joint]
            wanted = min(max(busy + wanted, -limit), limit) - busy if excess > 0.0 else 0.0
            change = wanted - brake[joint]
            for other in range(count):
                coming[other] += mobility[other, joint] * change
            brake[joint] = wanted
            largest = max(largest, abs(change))
        if largest < _SETTLED_NM:
            break
    return brake
