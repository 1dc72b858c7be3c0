"""Brakes of the joints: hold joints that would get too fast, with what their motors have left."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.robots.sawyer import JOINT_COUNT, SPEED_LIMIT_RAD_S, TORQUE_LIMIT_NM

Array = NDArray[np.float64]

_SWEEPS = 40
_SETTLED_NM = 1e-6


@njit(cache=True, nogil=True)
def brake_torques(
    coming: Array, mobility: Array, motor: Array, damping: Array, brake_from: float, brake_full: float
) -> Array:
    """Brake torques (7,) in Nm for the coming step, solved implicitly for all joints together.

    Every brake is viscous, from nothing at `brake_from` of its joint's speed limit to the joint's whole
    torque at `brake_full`. Solved by projected Gauss-Seidel, it is stable however stiff it is.

    Parameters
    ----------
    coming
        Joint rates at the end of the step without brakes, shape (7,), rad/s; changed to those with them.
    mobility
        Change of the rates by torques over the step, shape (7, 7).
    motor, damping
        Torques of the motors at rates of zero (Nm), and how they fall with the rates (Nm s), shape (7,).
    brake_from, brake_full
        Shares of the speed limits.
    """
    brake = np.zeros(JOINT_COUNT)
    for _ in range(_SWEEPS):
        largest = 0.0
        for joint in range(JOINT_COUNT):
            own = mobility[joint, joint]
            soft = brake_from * SPEED_LIMIT_RAD_S[joint]
            slope = TORQUE_LIMIT_NM[joint] / ((brake_full - brake_from) * SPEED_LIMIT_RAD_S[joint])
            free = coming[joint] - own * brake[joint]
            excess = max(abs(free) - soft, 0.0)
            wanted = -math.copysign(slope * excess / (1.0 + slope * own), free)
            # What the motor has left beside its other work.
            busy = motor[joint] - damping[joint] * coming[joint]
            limit = TORQUE_LIMIT_NM[joint]
            wanted = min(max(busy + wanted, -limit), limit) - busy if excess > 0.0 else 0.0
            change = wanted - brake[joint]
            coming += mobility[:, joint] * change
            brake[joint] = wanted
            largest = max(largest, abs(change))
        if largest < _SETTLED_NM:
            break
    return brake
