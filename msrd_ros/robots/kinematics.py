"""Where the paddle and the links of the arm are, from the joint angles alone.

Compiled forward kinematics of a serial arm (`ArmModel`), shared by the Bullet simulator (one call per
millisecond), the batched simulator (called from compiled loops) and the stroke planner. Everything is in
the frame `world`; a twist is stacked velocity over angular velocity, both in `world`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def _turn_onto_child(arm: Arm, index: int, angle: float, position: Array, rotation: Array) -> None:
    """Move a frame, in place, from the parent link of joint `index` onto its child link."""
    offset, turn = arm[0].offsets[index], arm[0].rotations[index]
    c, s = math.cos(angle), math.sin(angle)
    for row in range(3):
        r0, r1, r2 = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        position[row] += r0 * offset[0] + r1 * offset[1] + r2 * offset[2]
        x = r0 * turn[0, 0] + r1 * turn[1, 0] + r2 * turn[2, 0]
        y = r0 * turn[0, 1] + r1 * turn[1, 1] + r2 * turn[2, 1]
        rotation[row, 2] = r0 * turn[0, 2] + r1 * turn[1, 2] + r2 * turn[2, 2]
        rotation[row, 0] = x * c + y * s
        rotation[row, 1] = y * c - x * s


@njit(cache=True, nogil=True)
def _turn_onto_paddle(arm: Arm, position: Array, rotation: Array) -> None:
    """Move a frame, in place, from the last link onto the paddle."""
    offset, turn = arm[0].paddle_position, arm[0].paddle_rotation
    for row in range(3):
        r0, r1, r2 = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        position[row] += r0 * offset[0] + r1 * offset[1] + r2 * offset[2]
        for column in range(3):
            rotation[row, column] = r0 * turn[0, column] + r1 * turn[1, column] + r2 * turn[2, column]


@njit(cache=True, nogil=True)
def _place_at_base(arm: Arm, position: Array, rotation: Array) -> None:
    for row in range(3):
        position[row] = arm[0].base_position[row]
        for column in range(3):
            rotation[row, column] = arm[0].base_rotation[row, column]


@njit(cache=True, nogil=True)
def place_paddle(arm: Arm, joint_position: Array, position: Array, rotation: Array) -> None:
    """Write the pose of the paddle into arrays that the caller keeps.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    joint_position
        Angles in rad, shape (N,).
    position
        Filled with the blade's centre in m, shape (3,).
    rotation
        Filled with its rotation, shape (3, 3): columns are its axes in `world`; column 1 is
        the normal of the front face, column 2 points along the handle to the blade.
    """
    count = len(arm[0].speed)
    _place_at_base(arm, position, rotation)
    for index in range(count):
        _turn_onto_child(arm, index, joint_position[index], position, rotation)
    _turn_onto_paddle(arm, position, rotation)


@njit(cache=True, nogil=True)
def place_moving_paddle(arm: Arm, joint_position: Array, joint_velocity: Array, paddle: Array) -> None:
    """Write pose and motion of the paddle as the twelve floats that the ball's contacts want.

    Velocities are carried outwards along the chain, which costs little more than the pose alone.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    joint_position, joint_velocity
        Shape (N,), rad and rad/s.
    paddle
        Filled with blade centre (m), normal of the front face, velocity of the centre (m/s) and angular
        velocity (rad/s), shape (12,).
    """
    count = len(arm[0].speed)
    position, rotation = np.empty(3), np.empty((3, 3))
    _place_at_base(arm, position, rotation)
    vx = vy = vz = wx = wy = wz = 0.0
    for index in range(count + 1):
        x, y, z = position[0], position[1], position[2]
        if index < count:
            _turn_onto_child(arm, index, joint_position[index], position, rotation)
        else:
            _turn_onto_paddle(arm, position, rotation)
        x, y, z = position[0] - x, position[1] - y, position[2] - z
        vx, vy, vz = vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
        if index < count:
            wx += joint_velocity[index] * rotation[0, 2]
            wy += joint_velocity[index] * rotation[1, 2]
            wz += joint_velocity[index] * rotation[2, 2]
    for row in range(3):
        paddle[row] = position[row]
        paddle[3 + row] = rotation[row, 1]
    paddle[6], paddle[7], paddle[8] = vx, vy, vz
    paddle[9], paddle[10], paddle[11] = wx, wy, wz


@njit(cache=True, nogil=True)
def paddle_pose(arm: Arm, joint_position: Array) -> tuple[Array, Array]:
    """Blade centre (3,) in m and rotation (3, 3) of the paddle; see `place_paddle`."""
    position = np.empty(3)
    rotation = np.empty((3, 3))
    place_paddle(arm, joint_position, position, rotation)
    return position, rotation


@njit(cache=True, nogil=True)
def link_frames(arm: Arm, joint_position: Array) -> tuple[Array, Array]:
    """Origins (N, 3) in m and rotations (N, 3, 3) of the links behind the joints."""
    count = len(arm[0].speed)
    positions = np.empty((count, 3))
    rotations = np.empty((count, 3, 3))
    position = np.empty(3)
    rotation = np.empty((3, 3))
    _place_at_base(arm, position, rotation)
    for index in range(count):
        _turn_onto_child(arm, index, joint_position[index], position, rotation)
        for row in range(3):
            positions[index, row] = position[row]
            for column in range(3):
                rotations[index, row, column] = rotation[row, column]
    return positions, rotations


@njit(cache=True, nogil=True)
def paddle_jacobian(arm: Arm, joint_position: Array) -> Array:
    """Geometric Jacobian (6, N) of the blade's centre: joint rates to velocity over angular velocity."""
    count = len(arm[0].speed)
    origins, rotations = link_frames(arm, joint_position)
    jacobian = np.empty((6, count))
    last, mount = rotations[count - 1], arm[0].paddle_position
    tip = origins[count - 1] + (last[:, 0] * mount[0] + last[:, 1] * mount[1] + last[:, 2] * mount[2])
    for index in range(count):
        ax, ay, az = rotations[index, 0, 2], rotations[index, 1, 2], rotations[index, 2, 2]
        dx, dy, dz = tip[0] - origins[index, 0], tip[1] - origins[index, 1], tip[2] - origins[index, 2]
        jacobian[0, index] = ay * dz - az * dy
        jacobian[1, index] = az * dx - ax * dz
        jacobian[2, index] = ax * dy - ay * dx
        jacobian[3, index] = ax
        jacobian[4, index] = ay
        jacobian[5, index] = az
    return jacobian
