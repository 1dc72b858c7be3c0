"""Forces in the arm: which joint torques a motion takes, from the published masses.

Compiled recursive Newton-Euler in the frames of the links (Luh, Walker and Paul 1980; Craig, Introduction
to Robotics, ch. 6). It is the robot's own model of itself: the simulated arm may be made heavier or
rougher than this without the controller knowing.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.robots.kinematics import rotation_from_roll_pitch_yaw
from msrd_ros.robots.sawyer import JOINT_COUNT
from msrd_ros.robots.sawyer_description import (
    ARM_JOINTS,
    BLADE_CENTRE_BEYOND_FLANGE_M,
    HEAD_JOINT,
    LINK_INERTIAS,
    LinkInertia,
    Vector,
    paddle_inertia,
)

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81

JOINT_FRICTION_NM_S: Array = np.array([2.0, 2.0, 1.0, 1.0, 0.15, 0.15, 0.02])
"""Viscous friction of the joints, per rad/s. Not published: a guess of ours at geared joints."""
JOINT_FRICTION_NM_S.setflags(write=False)


def inertia_matrix(link: LinkInertia) -> Array:
    """Inertia (3, 3) of a link about its own centre of mass, axes of its frame."""
    ixx, ixy, ixz, iyy, iyz, izz = link.inertia
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def joined(link: LinkInertia, load: LinkInertia, offset: Vector) -> tuple[float, Array, Array]:
    """Mass, centre (3,) and inertia (3, 3) of a link with an unturned load whose frame is at `offset`."""
    mass = link.mass + load.mass
    centres = np.array(link.centre), np.array(load.centre) + np.array(offset)
    centre = (link.mass * centres[0] + load.mass * centres[1]) / mass
    inertia = np.zeros((3, 3))
    for part, own_centre in zip((link, load), centres, strict=True):
        arm = own_centre - centre
        inertia += inertia_matrix(part) + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


def _moving_bodies() -> tuple[Array, Array, Array]:
    """Masses (7,), centres (7, 3) and inertias (7, 3, 3) of right_l0..right_l6 with head and paddle."""
    links = {link.name: link for link in LINK_INERTIAS}
    bodies = []
    for joint in ARM_JOINTS:
        link = links[joint.child]
        if joint.child == HEAD_JOINT.parent:
            bodies.append(joined(link, links["head"], HEAD_JOINT.offset))
        elif joint.child == "right_l6":
            bodies.append(joined(link, paddle_inertia(), (0.0, 0.0, BLADE_CENTRE_BEYOND_FLANGE_M)))
        else:
            bodies.append((link.mass, np.array(link.centre), inertia_matrix(link)))
    masses, centres, inertias = zip(*bodies, strict=True)
    return np.array(masses), np.array(centres), np.array(inertias)


_MASSES, _CENTRES, _INERTIAS = _moving_bodies()
_OFFSETS = np.array([joint.offset for joint in ARM_JOINTS])
_ROTATIONS = np.array([rotation_from_roll_pitch_yaw(*joint.roll_pitch_yaw) for joint in ARM_JOINTS])

Triple = tuple[float, float, float]


@njit(cache=True, nogil=True, inline="always")
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True, inline="always")
def _into_child(r: Array, v: Triple) -> Triple:
    return (
        r[0, 0] * v[0] + r[1, 0] * v[1] + r[2, 0] * v[2],
        r[0, 1] * v[0] + r[1, 1] * v[1] + r[2, 1] * v[2],
        r[0, 2] * v[0] + r[1, 2] * v[1] + r[2, 2] * v[2],
    )


@njit(cache=True, nogil=True, inline="always")
def _into_parent(r: Array, v: Triple) -> Triple:
    return (
        r[0, 0] * v[0] + r[0, 1] * v[1] + r[0, 2] * v[2],
        r[1, 0] * v[0] + r[1, 1] * v[1] + r[1, 2] * v[2],
        r[2, 0] * v[0] + r[2, 1] * v[1] + r[2, 2] * v[2],
    )


@njit(cache=True, nogil=True, inline="always")
def _carried(spin: Triple, change: Triple, arm: Triple) -> Triple:
    """Acceleration of a point at `arm` on a body that turns with `spin` and its rate of `change`."""
    along = _cross(change, arm)
    inward = _cross(spin, _cross(spin, arm))
    return along[0] + inward[0], along[1] + inward[1], along[2] + inward[2]


@njit(cache=True, nogil=True)
def inverse_dynamics_into(
    position: Array, velocity: Array, acceleration: Array, gravity: float, torque: Array
) -> None:
    """Write the torques (7,) in Nm of a motion into `torque`; see `inverse_dynamics`."""
    rotations = np.empty((JOINT_COUNT, 3, 3))
    forces = np.empty((JOINT_COUNT, 3))
    moments = np.empty((JOINT_COUNT, 3))
    spin = (0.0, 0.0, 0.0)
    change = (0.0, 0.0, 0.0)
    lift = (0.0, 0.0, gravity)
    for i in range(JOINT_COUNT):
        c, s = math.cos(position[i]), math.sin(position[i])
        r = rotations[i]
        for row in range(3):
            x, y = _ROTATIONS[i, row, 0], _ROTATIONS[i, row, 1]
            r[row, 0] = x * c + y * s
            r[row, 1] = y * c - x * s
            r[row, 2] = _ROTATIONS[i, row, 2]
        offset = (_OFFSETS[i, 0], _OFFSETS[i, 1], _OFFSETS[i, 2])
        extra = _carried(spin, change, offset)
        lift = _into_child(r, (lift[0] + extra[0], lift[1] + extra[1], lift[2] + extra[2]))
        w = _into_child(r, spin)
        dw = _into_child(r, change)
        rate = velocity[i]
        change = (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + acceleration[i])
        spin = (w[0], w[1], w[2] + rate)
        centre = (_CENTRES[i, 0], _CENTRES[i, 1], _CENTRES[i, 2])
        extra = _carried(spin, change, centre)
        mass = _MASSES[i]
        force = (mass * (lift[0] + extra[0]), mass * (lift[1] + extra[1]), mass * (lift[2] + extra[2]))
        inertia = _INERTIAS[i]
        turning = _into_parent(inertia, change)
        gyroscopic = _cross(spin, _into_parent(inertia, spin))
        lever = _cross(centre, force)
        for k in range(3):
            forces[i, k] = force[k]
            moments[i, k] = turning[k] + gyroscopic[k] + lever[k]
    force = (0.0, 0.0, 0.0)
    moment = (0.0, 0.0, 0.0)
    for back in range(JOINT_COUNT):
        i = JOINT_COUNT - 1 - back
        force = (force[0] + forces[i, 0], force[1] + forces[i, 1], force[2] + forces[i, 2])
        moment = (moment[0] + moments[i, 0], moment[1] + moments[i, 1], moment[2] + moments[i, 2])
        torque[i] = moment[2]
        force = _into_parent(rotations[i], force)
        moment = _into_parent(rotations[i], moment)
        lever = _cross((_OFFSETS[i, 0], _OFFSETS[i, 1], _OFFSETS[i, 2]), force)
        moment = (moment[0] + lever[0], moment[1] + lever[1], moment[2] + lever[2])


@njit(cache=True, nogil=True)
def inverse_dynamics(position: Array, velocity: Array, acceleration: Array) -> Array:
    """Joint torques (7,) in Nm that a motion takes, gravity included.

    Parameters
    ----------
    position, velocity, acceleration
        Of right_j0..right_j6, shape (7,); rad, rad/s, rad/s^2.
    """
    torque = np.empty(JOINT_COUNT)
    inverse_dynamics_into(position, velocity, acceleration, GRAVITY_M_S2, torque)
    return torque


@njit(cache=True, nogil=True)
def mass_matrix(position: Array) -> Array:
    """Joint-space inertia (7, 7) in kg m^2 at the given angles (7,)."""
    matrix = np.empty((JOINT_COUNT, JOINT_COUNT))
    still = np.zeros(JOINT_COUNT)
    unit = np.zeros(JOINT_COUNT)
    for joint in range(JOINT_COUNT):
        unit[joint] = 1.0
        inverse_dynamics_into(position, still, unit, 0.0, matrix[joint])
        unit[joint] = 0.0
    return matrix
