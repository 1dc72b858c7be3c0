"""The hand of a teacher who knows the arm's weight: it runs ahead of the paddle by what the grip gives.

To move the paddle along a wanted path the hand has to exert the force that the floating arm takes. Its
spring-damper gives K d + D d' for a lead d, so the lead that a practised hand takes obeys

    D d' = p W - K d,

where W is the wrench that the motion takes and p the teacher's practice, from 0 (leads along the path
itself, and the arm lags behind) to 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.table_tennis.dynamics import mass_matrix
from msrd_ros.table_tennis.hand_gesture import HandGesture
from msrd_ros.table_tennis.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.table_tennis.rotations import quaternion_from_rotation, turned
from msrd_ros.table_tennis.teaching import GuidanceConfig

Array = NDArray[np.float64]

_SINGULAR = 1e-3
"""Directions of the wrench that move the joints less than this share of the best one are left alone."""


def wrench_for(
    joint_position: Array, joint_velocity: Array, joint_acceleration: Array, config: GuidanceConfig
) -> Array:
    """Wrench (6,) in N and Nm at the paddle that moves the floating arm so, as far as a wrench there can.

    Parameters are of shape (7,), in rad, rad/s and rad/s^2.
    """
    damping = np.array(config.joint_damping_nm_s)
    torque = mass_matrix(joint_position) @ joint_acceleration + damping * joint_velocity
    wrench: Array = np.linalg.lstsq(paddle_jacobian(joint_position).T, torque, rcond=_SINGULAR)[0]
    return wrench


def gesture_along(
    times_s: Array,
    joint_positions: Array,
    joint_velocities: Array,
    joint_accelerations: Array,
    config: GuidanceConfig,
    practice: float = 1.0,
) -> HandGesture:
    """How a hand leads the paddle along a motion of the joints.

    Parameters
    ----------
    times_s
        Increasing, 10 ms apart or less, shape (N,).
    joint_positions, joint_velocities, joint_accelerations
        The motion, shape (N, 7); at rest at its start.
    config
        How the hand holds the paddle.
    practice
        Share of the arm's weight that the teacher reckons with.
    """
    stiffness = np.repeat([config.stiffness_n_m, config.turn_stiffness_nm], 3)
    damping = np.repeat([config.damping_n_s_m, config.turn_damping_nm_s], 3)
    count = len(times_s)
    wrenches = practice * np.array(
        [
            wrench_for(*state, config)
            for state in zip(joint_positions, joint_velocities, joint_accelerations, strict=True)
        ]
    )
    leads = np.zeros((count, 6))
    for index in range(1, count):
        # Exact for a wrench that is constant over the interval.
        keep = np.exp(-stiffness / damping * (times_s[index] - times_s[index - 1]))
        mean = 0.5 * (wrenches[index - 1] + wrenches[index])
        leads[index] = keep * leads[index - 1] + (1.0 - keep) * mean / stiffness
    rates = (wrenches - stiffness * leads) / damping
    positions, quaternions, twists = np.empty((count, 3)), np.empty((count, 4)), np.empty((count, 6))
    for index, (joints, joint_rates) in enumerate(zip(joint_positions, joint_velocities, strict=True)):
        centre, rotation = paddle_pose(joints)
        positions[index] = centre + leads[index, :3]
        quaternions[index] = quaternion_from_rotation(turned(rotation, leads[index, 3:]))
        twists[index] = paddle_jacobian(joints) @ joint_rates + rates[index]
    return HandGesture(np.asarray(times_s), positions, quaternions, twists[:, :3], twists[:, 3:])
