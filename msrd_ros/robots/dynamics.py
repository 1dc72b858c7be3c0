"""Forces in the arm: which joint torques a motion takes, from its masses.

Compiled recursive Newton-Euler in the frames of the links (Luh, Walker and Paul 1980; Craig, Introduction
to Robotics, ch. 6). It is the robot's own model of itself: the simulated arm may be made heavier or
rougher than this without the controller knowing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81

Triple = tuple[float, float, float]


@njit(cache=True, nogil=True)
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def _into_child(r: Array, v: Triple) -> Triple:
    return (
        r[0, 0] * v[0] + r[1, 0] * v[1] + r[2, 0] * v[2],
        r[0, 1] * v[0] + r[1, 1] * v[1] + r[2, 1] * v[2],
        r[0, 2] * v[0] + r[1, 2] * v[1] + r[2, 2] * v[2],
    )


@njit(cache=True, nogil=True)
def _into_parent(r: Array, v: Triple) -> Triple:
    return (
        r[0, 0] * v[0] + r[0, 1] * v[1] + r[0, 2] * v[2],
        r[1, 0] * v[0] + r[1, 1] * v[1] + r[1, 2] * v[2],
        r[2, 0] * v[0] + r[2, 1] * v[1] + r[2, 2] * v[2],
    )


@njit(cache=True, nogil=True)
def _carried(spin: Triple, change: Triple, arm: Triple) -> Triple:
    """Acceleration of a point at `arm` on a body that turns with `spin` and its rate of `change`."""
    along = _cross(change, arm)
    inward = _cross(spin, _cross(spin, arm))
    return along[0] + inward[0], along[1] + inward[1], along[2] + inward[2]


@njit(cache=True, nogil=True)
def inverse_dynamics_into(
    arm: Arm, position: Array, velocity: Array, acceleration: Array, gravity: float, torque: Array
) -> None:
    """Write the torques (N,) in Nm of a motion into `torque`; see `inverse_dynamics`."""
    count, offsets, turns = len(arm[0].speed), arm[0].offsets, arm[0].rotations
    rotations = np.empty((count, 3, 3))
    forces = np.empty((count, 3))
    moments = np.empty((count, 3))
    spin = (0.0, 0.0, 0.0)
    change = (0.0, 0.0, 0.0)
    stand = arm[0].base_rotation
    lift = (gravity * stand[2, 0], gravity * stand[2, 1], gravity * stand[2, 2])
    for i in range(count):
        c, s = math.cos(position[i]), math.sin(position[i])
        r = rotations[i]
        for row in range(3):
            x, y = turns[i, row, 0], turns[i, row, 1]
            r[row, 0] = x * c + y * s
            r[row, 1] = y * c - x * s
            r[row, 2] = turns[i, row, 2]
        offset = (offsets[i, 0], offsets[i, 1], offsets[i, 2])
        extra = _carried(spin, change, offset)
        lift = _into_child(r, (lift[0] + extra[0], lift[1] + extra[1], lift[2] + extra[2]))
        w = _into_child(r, spin)
        dw = _into_child(r, change)
        rate = velocity[i]
        change = (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + acceleration[i])
        spin = (w[0], w[1], w[2] + rate)
        centre = (arm[0].centres[i, 0], arm[0].centres[i, 1], arm[0].centres[i, 2])
        extra = _carried(spin, change, centre)
        mass = arm[0].masses[i]
        force = (mass * (lift[0] + extra[0]), mass * (lift[1] + extra[1]), mass * (lift[2] + extra[2]))
        inertia = arm[0].inertias[i]
        turning = _into_parent(inertia, change)
        gyroscopic = _cross(spin, _into_parent(inertia, spin))
        lever = _cross(centre, force)
        for k in range(3):
            forces[i, k] = force[k]
            moments[i, k] = turning[k] + gyroscopic[k] + lever[k]
    force = (0.0, 0.0, 0.0)
    moment = (0.0, 0.0, 0.0)
    for back in range(count):
        i = count - 1 - back
        force = (force[0] + forces[i, 0], force[1] + forces[i, 1], force[2] + forces[i, 2])
        moment = (moment[0] + moments[i, 0], moment[1] + moments[i, 1], moment[2] + moments[i, 2])
        torque[i] = moment[2]
        force = _into_parent(rotations[i], force)
        moment = _into_parent(rotations[i], moment)
        lever = _cross((offsets[i, 0], offsets[i, 1], offsets[i, 2]), force)
        moment = (moment[0] + lever[0], moment[1] + lever[1], moment[2] + lever[2])


@njit(cache=True, nogil=True)
def inverse_dynamics(arm: Arm, position: Array, velocity: Array, acceleration: Array) -> Array:
    """Joint torques (N,) in Nm that a motion takes, gravity included.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    position, velocity, acceleration
        Of the joints, shape (N,); rad, rad/s, rad/s^2.
    """
    torque = np.empty(len(arm[0].speed))
    inverse_dynamics_into(arm, position, velocity, acceleration, GRAVITY_M_S2, torque)
    return torque


@njit(cache=True, nogil=True)
def mass_matrix(arm: Arm, position: Array) -> Array:
    """Joint-space inertia (N, N) in kg m^2 at the given angles (N,)."""
    count = len(arm[0].speed)
    matrix = np.empty((count, count))
    still = np.zeros(count)
    unit = np.zeros(count)
    for joint in range(count):
        unit[joint] = 1.0
        inverse_dynamics_into(arm, position, still, unit, 0.0, matrix[joint])
        unit[joint] = 0.0
    return matrix
