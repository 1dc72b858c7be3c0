"""Where a hand has to be so that the arm it leads is where it shall be.

The hand holds the paddle by a spring-damper, so it must run ahead of the paddle by as much as the arm
resists. Whoever has led this arm for a while knows how it resists; here that is the robot's own dynamics.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.dynamics import inverse_dynamics_into
from msrd_ros.robots.inverse_kinematics import joint_rates_for_twist
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.rotations import quaternion_from_rotation, turned

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def leading_wrench(
    arm: Arm, position: Array, velocity: Array, acceleration: Array, joint_damping: Array
) -> Array:
    """Force (N) over torque (Nm) at the paddle, shape (6,), that moves a floating arm like this.

    Parameters
    ----------
    position, velocity, acceleration
        Of the joints, shape (N,); rad, rad/s, rad/s^2.
    joint_damping
        Of the floating arm, shape (N,), Nm s.
    """
    torque = np.empty(len(arm[0].speed))
    inverse_dynamics_into(arm, position, velocity, acceleration, 0.0, torque)
    torque += joint_damping * velocity
    jacobian = paddle_jacobian(arm, position)
    gram = jacobian @ jacobian.T
    for row in range(6):
        gram[row, row] += 1e-6
    wrench: Array = np.linalg.solve(gram, jacobian @ torque).astype(np.float64)
    return wrench


@njit(cache=True, nogil=True)
def leading_hand(
    arm: Arm,
    position: Array,
    velocity: Array,
    acceleration: Array,
    joint_damping: Array,
    stiffness: float,
    turn_stiffness: float,
    skill: float,
    offset: Array,
    offset_rate: Array,
) -> tuple[Array, Array, Array]:
    """Position (3,), quaternion (4,) and twist (6,) of the hand that leads the joints through a state.

    Parameters
    ----------
    position, velocity, acceleration
        Where the joints shall be, shape (N,).
    stiffness, turn_stiffness
        Of the hand's grip, N/m and Nm/rad.
    skill
        Share of the needed lead that the hand takes; 1 is perfect, 0 always behind.
    offset, offset_rate
        Unwanted displacement of the hand (m over rad) and its rate, shape (6,).
    """
    wrench = leading_wrench(arm, position, velocity, acceleration, joint_damping)
    centre, rotation = paddle_pose(arm, position)
    twist = paddle_jacobian(arm, position) @ velocity + offset_rate
    centre += skill * wrench[:3] / stiffness + offset[:3]
    rotation = turned(rotation, skill * wrench[3:] / turn_stiffness + offset[3:])
    return centre, quaternion_from_rotation(rotation), twist


@njit(cache=True, nogil=True)
def shifted_posture(arm: Arm, position: Array, shift: Array) -> Array:
    """Joint angles (N,) near `position` whose paddle is displaced by `shift` (m over rad, shape (6,))."""
    return position + joint_rates_for_twist(
        paddle_jacobian(arm, position), shift, np.zeros(len(position)), 0.02
    )
