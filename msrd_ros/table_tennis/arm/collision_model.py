"""Keeps the arm off table and floor: whether joints may move like this, and still stop before they touch.

The arm is a handful of spheres on its links. From a state of the joints follows the path on which all of
them brake as hard as they may; the state is safe if the spheres stay clear of the obstacles along it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import link_frames
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.ball.surfaces import box_gap

Array = NDArray[np.float64]

MARGIN_M = 0.03
"""Kept free between arm and obstacles."""

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
def clearance(arm: Arm, joint_position: Array, table: Array) -> float:
    """Least distance in m between the arm at `joint_position` (N,) and table (`obstacle`) or floor."""
    origins, rotations = link_frames(arm, joint_position)
    links, centres, radii = arm[0].sphere_links, arm[0].sphere_centres, arm[0].sphere_radii
    least = math.inf
    for sphere in range(len(radii)):
        link = links[sphere]
        c0, c1, c2 = centres[sphere, 0], centres[sphere, 1], centres[sphere, 2]
        x = origins[link, 0] + rotations[link, 0, 0] * c0 + rotations[link, 0, 1] * c1
        y = origins[link, 1] + rotations[link, 1, 0] * c0 + rotations[link, 1, 1] * c1
        z = origins[link, 2] + rotations[link, 2, 0] * c0 + rotations[link, 2, 1] * c1
        x += rotations[link, 0, 2] * c2
        y += rotations[link, 1, 2] * c2
        z += rotations[link, 2, 2] * c2
        gap, _, _, _ = box_gap(x, y, z, table[0], table[1], table[2], table[3])
        least = min(least, gap - radii[sphere], z - radii[sphere])
    return least


@njit(cache=True, nogil=True)
def self_clearance(arm: Arm, joint_position: Array) -> float:
    """Least distance in m between parts of the arm that must not meet, and of those to its stand."""
    origins, rotations = link_frames(arm, joint_position)
    links, centres, radii = arm[0].sphere_links, arm[0].sphere_centres, arm[0].sphere_radii
    stand, apart = arm[0].stand, arm[0].apart
    places = np.empty((len(radii), 3))
    for sphere in range(len(radii)):
        link = links[sphere]
        for row in range(3):
            places[sphere, row] = (
                origins[link, row]
                + rotations[link, row, 0] * centres[sphere, 0]
                + rotations[link, row, 1] * centres[sphere, 1]
                + rotations[link, row, 2] * centres[sphere, 2]
            )
    least = math.inf
    for pair in range(len(apart)):
        one, other = apart[pair, 0], apart[pair, 1]
        if one != other:
            gap = np.sqrt(np.sum((places[one] - places[other]) ** 2)) - radii[one] - radii[other]
            least = min(least, gap)
    for sphere in range(len(radii)):
        if links[sphere] >= 2:
            for post in range(len(stand)):
                gap = np.sqrt(np.sum((places[sphere] - stand[post, :3]) ** 2)) - radii[sphere]
                least = min(least, gap - stand[post, 3])
    return least


@njit(cache=True, nogil=True)
def braking_clearance(arm: Arm, joint_position: Array, joint_velocity: Array, table: Array) -> float:
    """Least clearance in m on the way on which all joints brake as hard as they may.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    joint_position, joint_velocity
        Where braking starts, shape (N,), rad and rad/s.
    table
        Of `obstacle`.
    """
    count, limits = len(arm[0].speed), arm[0].acceleration
    longest = 0.0
    for joint in range(count):
        longest = max(longest, abs(joint_velocity[joint]) / limits[joint])
    least = math.inf
    joints = np.empty(count)
    for sample in range(1, _SAMPLES + 1):
        time = longest * sample / _SAMPLES
        for joint in range(count):
            speed, limit = joint_velocity[joint], limits[joint]
            braked = min(time, abs(speed) / limit)
            joints[joint] = (
                joint_position[joint] + speed * braked - math.copysign(0.5 * limit * braked * braked, speed)
            )
        least = min(least, clearance(arm, joints, table))
    return least
