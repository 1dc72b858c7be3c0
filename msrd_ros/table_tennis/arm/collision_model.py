"""Keeps the arm off table and floor: whether joints may move like this, and still stop before they touch.

The arm is a handful of spheres on its links. From a state of the joints follows the path on which all of
them brake as hard as they may; the state is safe if the spheres stay clear of the obstacles along it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.robots.kinematics import link_frames
from msrd_ros.robots.limits import ACCELERATION_LIMIT_RAD_S2
from msrd_ros.robots.sawyer import JOINT_COUNT
from msrd_ros.robots.sawyer_description import BLADE_CENTRE_BEYOND_FLANGE_M, BLADE_RADIUS_M
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.ball.surfaces import box_gap

Array = NDArray[np.float64]

MARGIN_M = 0.03
"""Kept free between arm and obstacles."""

_SPHERES = (
    # link, centre in its frame, radius
    (2, (0.0, 0.01, 0.26), 0.085),
    (3, (0.0, 0.0, -0.1265), 0.078),
    (4, (0.0, 0.0, 0.02), 0.062),
    (4, (0.0, 0.0, 0.14), 0.055),
    (4, (0.0, -0.015, 0.275), 0.072),
    (5, (0.0, 0.0, 0.1053), 0.066),
    (5, (0.0, -0.08, 0.1053), 0.052),
    (6, (0.0, 0.0, 0.0), 0.048),
    (6, (0.0, 0.0, 0.10), 0.040),
    (6, (0.0, 0.0, BLADE_CENTRE_BEYOND_FLANGE_M), BLADE_RADIUS_M + 0.004),
)
_LINK = np.array([sphere[0] for sphere in _SPHERES])
_CENTRE = np.array([sphere[1] for sphere in _SPHERES])
_RADIUS = np.array([sphere[2] for sphere in _SPHERES])
_SAMPLES = 4
"""Of the braking path."""


def obstacle(table: Table) -> Array:
    """The table as half length, half width, underside and top in m, shape (4,)."""
    return np.array(
        [
            table.length_m / 2,
            table.width_m / 2,
            table.height_m - table.thickness_m,
            table.height_m,
        ]
    )


@njit(cache=True, nogil=True)
def clearance(joint_position: Array, table: Array) -> float:
    """Least distance in m between the arm at `joint_position` (7,) and table (`obstacle`) or floor."""
    origins, rotations = link_frames(joint_position)
    least = math.inf
    for sphere in range(len(_RADIUS)):
        link = _LINK[sphere]
        c0, c1, c2 = _CENTRE[sphere, 0], _CENTRE[sphere, 1], _CENTRE[sphere, 2]
        x = origins[link, 0] + rotations[link, 0, 0] * c0 + rotations[link, 0, 1] * c1
        y = origins[link, 1] + rotations[link, 1, 0] * c0 + rotations[link, 1, 1] * c1
        z = origins[link, 2] + rotations[link, 2, 0] * c0 + rotations[link, 2, 1] * c1
        x += rotations[link, 0, 2] * c2
        y += rotations[link, 1, 2] * c2
        z += rotations[link, 2, 2] * c2
        gap, _, _, _ = box_gap(x, y, z, table[0], table[1], table[2], table[3])
        least = min(least, gap - _RADIUS[sphere], z - _RADIUS[sphere])
    return least


@njit(cache=True, nogil=True)
def braking_clearance(joint_position: Array, joint_velocity: Array, table: Array) -> float:
    """Least clearance in m on the way on which all joints brake as hard as they may.

    Parameters
    ----------
    joint_position, joint_velocity
        Where braking starts, shape (7,), rad and rad/s.
    table
        Of `obstacle`.
    """
    longest = 0.0
    for joint in range(JOINT_COUNT):
        longest = max(longest, abs(joint_velocity[joint]) / ACCELERATION_LIMIT_RAD_S2[joint])
    least = math.inf
    joints = np.empty(JOINT_COUNT)
    for sample in range(1, _SAMPLES + 1):
        time = longest * sample / _SAMPLES
        for joint in range(JOINT_COUNT):
            speed, limit = joint_velocity[joint], ACCELERATION_LIMIT_RAD_S2[joint]
            braked = min(time, abs(speed) / limit)
            joints[joint] = (
                joint_position[joint] + speed * braked - math.copysign(0.5 * limit * braked * braked, speed)
            )
        least = min(least, clearance(joints, table))
    return least
