"""Where the paddle was at recorded joint angles: forward kinematics of `ArmModel` without a compiler."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]


class PaddlePoses(NamedTuple):
    """The blade's centre (n, 3) in m and the unit normal (n, 3) of its front face, in `world`."""

    place: Array
    normal: Array


def paddle_poses(robot: Robot, joint_position: Array) -> PaddlePoses:
    """Where the paddle is at joint angles (n, N) in rad.

    What `robots.kinematics` computes; bags are read without the compiler that it needs.
    """
    arm = robot.model[0]
    count = len(joint_position)
    place = np.tile(arm["base_position"], (count, 1))
    rotation = np.tile(arm["base_rotation"], (count, 1, 1))
    for offset, turn, angle in zip(arm["offsets"], arm["rotations"], joint_position.T, strict=True):
        place = place + rotation @ offset
        rotation = rotation @ turn @ _turns_about_z(angle)
    place = place + rotation @ arm["paddle_position"]
    return PaddlePoses(place, (rotation @ arm["paddle_rotation"])[:, :, 1])


def _turns_about_z(angle: Array) -> Array:
    """Rotations (n, 3, 3) about z by angles (n,) in rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(angle), np.ones_like(angle)
    rows = [[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]
    return np.array(rows).transpose(2, 0, 1)
