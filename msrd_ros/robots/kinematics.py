"""Where the paddle and the links of the arm are, from the joint angles alone.

Compiled forward kinematics from the published facts, shared by the Bullet simulator (one call per
millisecond), the batched simulator (called from compiled loops) and the stroke planner. Everything is in
the frame `world`; a twist is stacked velocity over angular velocity, both in `world`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.robots.sawyer import JOINT_COUNT
from msrd_ros.robots.sawyer_description import (
    ARM_JOINTS,
    BASE_POSITION,
    BLADE_CENTRE_BEYOND_FLANGE_M,
)

Array = NDArray[np.float64]


def rotation_from_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix (3, 3) of fixed-axis roll, pitch and yaw in rad, as URDF has them."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


LINK_NAMES: tuple[str, ...] = tuple(joint.child for joint in ARM_JOINTS)
"""The moving links, in the order of `link_frames`."""

_BASE = np.array(BASE_POSITION)
_OFFSETS = np.array([joint.offset for joint in ARM_JOINTS])
_ROTATIONS = np.array([rotation_from_roll_pitch_yaw(*joint.roll_pitch_yaw) for joint in ARM_JOINTS])
_REACH = BLADE_CENTRE_BEYOND_FLANGE_M


@njit(cache=True, nogil=True)
def _turn_onto_child(index: int, angle: float, position: Array, rotation: Array) -> None:
    """Move a frame, in place, from the parent link of joint `index` onto its child link."""
    c, s = math.cos(angle), math.sin(angle)
    for row in range(3):
        r0, r1, r2 = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        position[row] += r0 * _OFFSETS[index, 0] + r1 * _OFFSETS[index, 1] + r2 * _OFFSETS[index, 2]
        x = r0 * _ROTATIONS[index, 0, 0] + r1 * _ROTATIONS[index, 1, 0] + r2 * _ROTATIONS[index, 2, 0]
        y = r0 * _ROTATIONS[index, 0, 1] + r1 * _ROTATIONS[index, 1, 1] + r2 * _ROTATIONS[index, 2, 1]
        rotation[row, 2] = (
            r0 * _ROTATIONS[index, 0, 2] + r1 * _ROTATIONS[index, 1, 2] + r2 * _ROTATIONS[index, 2, 2]
        )
        rotation[row, 0] = x * c + y * s
        rotation[row, 1] = y * c - x * s


@njit(cache=True, nogil=True)
def _place_at_base(position: Array, rotation: Array) -> None:
    for row in range(3):
        position[row] = _BASE[row]
        for column in range(3):
            rotation[row, column] = 1.0 if row == column else 0.0


@njit(cache=True, nogil=True)
def place_paddle(joint_position: Array, position: Array, rotation: Array) -> None:
    """Write the pose of the paddle into arrays that the caller keeps.

    Parameters
    ----------
    joint_position
        Angles of right_j0..right_j6 in rad, shape (7,).
    position
        Filled with the blade's centre in m, shape (3,).
    rotation
        Filled with the rotation of `right_l6`, shape (3, 3): columns are its axes in `world`; column 1 is
        the normal of the front face, column 2 points along the handle to the blade.
    """
    _place_at_base(position, rotation)
    for index in range(JOINT_COUNT):
        _turn_onto_child(index, joint_position[index], position, rotation)
    for row in range(3):
        position[row] += _REACH * rotation[row, 2]


@njit(cache=True, nogil=True)
def place_moving_paddle(joint_position: Array, joint_velocity: Array, paddle: Array) -> None:
    """Write pose and motion of the paddle as the twelve floats that the ball's contacts want.

    Velocities are carried outwards along the chain, which costs little more than the pose alone.

    Parameters
    ----------
    joint_position, joint_velocity
        Shape (7,), rad and rad/s.
    paddle
        Filled with blade centre (m), normal of the front face, velocity of the centre (m/s) and angular
        velocity (rad/s), shape (12,).
    """
    position, rotation = np.empty(3), np.empty((3, 3))
    _place_at_base(position, rotation)
    vx = vy = vz = wx = wy = wz = 0.0
    for index in range(JOINT_COUNT + 1):
        x, y, z = position[0], position[1], position[2]
        if index < JOINT_COUNT:
            _turn_onto_child(index, joint_position[index], position, rotation)
        else:
            for row in range(3):
                position[row] += _REACH * rotation[row, 2]
        x, y, z = position[0] - x, position[1] - y, position[2] - z
        vx, vy, vz = vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
        if index < JOINT_COUNT:
            wx += joint_velocity[index] * rotation[0, 2]
            wy += joint_velocity[index] * rotation[1, 2]
            wz += joint_velocity[index] * rotation[2, 2]
    for row in range(3):
        paddle[row] = position[row]
        paddle[3 + row] = rotation[row, 1]
    paddle[6], paddle[7], paddle[8] = vx, vy, vz
    paddle[9], paddle[10], paddle[11] = wx, wy, wz


@njit(cache=True, nogil=True)
def paddle_pose(joint_position: Array) -> tuple[Array, Array]:
    """Blade centre (3,) in m and rotation (3, 3) of the paddle; see `place_paddle`."""
    position = np.empty(3)
    rotation = np.empty((3, 3))
    place_paddle(joint_position, position, rotation)
    return position, rotation


@njit(cache=True, nogil=True)
def link_frames(joint_position: Array) -> tuple[Array, Array]:
    """Origins (7, 3) in m and rotations (7, 3, 3) of right_l0..right_l6."""
    positions = np.empty((JOINT_COUNT, 3))
    rotations = np.empty((JOINT_COUNT, 3, 3))
    position = np.empty(3)
    rotation = np.empty((3, 3))
    _place_at_base(position, rotation)
    for index in range(JOINT_COUNT):
        _turn_onto_child(index, joint_position[index], position, rotation)
        positions[index] = position
        rotations[index] = rotation
    return positions, rotations


@njit(cache=True, nogil=True)
def paddle_jacobian(joint_position: Array) -> Array:
    """Geometric Jacobian (6, 7) of the blade's centre: joint rates to velocity over angular velocity."""
    origins, rotations = link_frames(joint_position)
    jacobian = np.empty((6, JOINT_COUNT))
    tip = origins[JOINT_COUNT - 1] + _REACH * rotations[JOINT_COUNT - 1, :, 2]
    for index in range(JOINT_COUNT):
        ax, ay, az = rotations[index, 0, 2], rotations[index, 1, 2], rotations[index, 2, 2]
        dx, dy, dz = tip[0] - origins[index, 0], tip[1] - origins[index, 1], tip[2] - origins[index, 2]
        jacobian[0, index] = ay * dz - az * dy
        jacobian[1, index] = az * dx - ax * dz
        jacobian[2, index] = ax * dy - ay * dx
        jacobian[3, index] = ax
        jacobian[4, index] = ay
        jacobian[5, index] = az
    return jacobian


@njit(cache=True, nogil=True)
def paddle_twist(joint_position: Array, joint_velocity: Array) -> Array:
    """Velocity (m/s) over angular velocity (rad/s) of the blade's centre, shape (6,)."""
    jacobian = paddle_jacobian(joint_position)
    twist = np.zeros(6)
    for row in range(6):
        for column in range(JOINT_COUNT):
            twist[row] += jacobian[row, column] * joint_velocity[column]
    return twist
