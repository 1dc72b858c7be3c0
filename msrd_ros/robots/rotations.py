"""Rotation matrices and quaternions (x, y, z, w), compiled, for single rotations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def quaternion_from_rotation(rotation: Array) -> Array:
    """Unit quaternion x, y, z, w with w >= 0 of a rotation matrix (3, 3)."""
    # 4 q q^T has these diagonal entries; dividing by the largest is always well conditioned.
    xx = 1.0 + rotation[0, 0] - rotation[1, 1] - rotation[2, 2]
    yy = 1.0 - rotation[0, 0] + rotation[1, 1] - rotation[2, 2]
    zz = 1.0 - rotation[0, 0] - rotation[1, 1] + rotation[2, 2]
    ww = 1.0 + rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    xy, xz, yz = (
        rotation[0, 1] + rotation[1, 0],
        rotation[0, 2] + rotation[2, 0],
        rotation[1, 2] + rotation[2, 1],
    )
    xw, yw, zw = (
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    )
    largest = max(xx, yy, zz, ww)
    if largest == ww:
        quaternion = np.array([xw, yw, zw, ww])
    elif largest == xx:
        quaternion = np.array([xx, xy, xz, xw])
    elif largest == yy:
        quaternion = np.array([xy, yy, yz, yw])
    else:
        quaternion = np.array([xz, yz, zz, zw])
    norm = 0.0
    for index in range(4):
        norm += quaternion[index] * quaternion[index]
    norm = math.copysign(math.sqrt(norm), quaternion[3])
    for index in range(4):
        quaternion[index] /= norm
    return quaternion


@njit(cache=True, nogil=True)
def rotation_from_quaternion(quaternion: Array) -> Array:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    k = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1.0 - k * (y * y + z * z), k * (x * y - z * w), k * (x * z + y * w)],
            [k * (x * y + z * w), 1.0 - k * (x * x + z * z), k * (y * z - x * w)],
            [k * (x * z - y * w), k * (y * z + x * w), 1.0 - k * (x * x + y * y)],
        ]
    )


@njit(cache=True, nogil=True)
def turn_between(start: Array, goal: Array) -> Array:
    """Rotation vector (3,) in rad, in the outer frame, that turns rotation `start` onto `goal` (3, 3)."""
    quaternion = quaternion_from_rotation(goal @ start.T)
    sine = math.sqrt(quaternion[0] ** 2 + quaternion[1] ** 2 + quaternion[2] ** 2)
    if sine < 1e-9:
        return 2.0 * quaternion[:3]
    return quaternion[:3] * (2.0 * math.atan2(sine, quaternion[3]) / sine)


@njit(cache=True, nogil=True)
def turned(start: Array, turn: Array) -> Array:
    """Rotation (3, 3) that `start` becomes when turned by the rotation vector `turn` (3,) in rad."""
    angle = math.sqrt(np.sum(turn * turn))
    half = 0.5 * angle
    scale = math.sin(half) / angle if angle > 1e-12 else 0.5
    quaternion = np.array([turn[0] * scale, turn[1] * scale, turn[2] * scale, math.cos(half)])
    return rotation_from_quaternion(quaternion) @ start
