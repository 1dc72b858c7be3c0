"""Joint angles and joint rates that put the paddle where it is wanted.

Damped least squares with the arm's one spare degree of freedom drawn towards a posture. Two kinds of
target: the whole pose of the paddle, or the blade only (centre and normal: the handle may turn about the
normal, which is all that the ball feels).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import turn_between

Array = NDArray[np.float64]


class Reached(NamedTuple):
    """Joint angles (N,) in rad found, and how far they miss the target in m and rad."""

    joint_position: Array
    distance_m: float
    angle_rad: float


@njit(cache=True, nogil=True)
def joint_rates_for_twist(jacobian: Array, twist: Array, posture_rate: Array, damping: float) -> Array:
    """Joint rates (N,) in rad/s that move the paddle with `twist`, not limited in speed.

    Parameters
    ----------
    jacobian
        Rows of the task, shape (m, N); all six of `paddle_jacobian`, or some combination of them.
    twist
        Wanted task velocity, shape (m,).
    posture_rate
        Joint rates preferred as far as the task leaves room, shape (N,).
    damping
        Trades exactness for small joint rates near singular postures; 0.01 to 0.05.
    """
    rows = jacobian.shape[0]
    gram = jacobian @ jacobian.T
    for row in range(rows):
        gram[row, row] += damping * damping
    return posture_rate + jacobian.T @ np.linalg.solve(gram, twist - jacobian @ posture_rate)


@njit(cache=True, nogil=True)
def _search(
    arm: Arm,
    position: Array,
    rotation: Array,
    normal_only: bool,
    start: Array,
    posture: Array,
    lower: Array,
    upper: Array,
    posture_pull: float,
    steps: int,
) -> tuple[Array, float, float]:
    joints = start.copy()
    distance, angle = np.inf, np.inf
    for step in range(steps):
        here, turned = paddle_pose(arm, joints)
        jacobian = paddle_jacobian(arm, joints)
        error = np.empty(6)
        error[:3] = position - here
        if normal_only:
            # The turn that brings the normals together; what remains about the normal is nobody's concern.
            a, b = turned[:, 1], rotation[:, 1]
            cross = np.array(
                [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
            )
            sine = np.sqrt(np.sum(cross * cross))
            angle = np.arctan2(sine, np.sum(a * b))
            error[3:] = cross * (angle / sine) if sine > 1e-12 else cross
            across = np.empty((2, 3))
            across[0] = turned[:, 0]
            across[1] = turned[:, 2]
            task = np.empty((5, len(joints)))
            task[:3] = jacobian[:3]
            task[3:] = across @ jacobian[3:]
            goal = np.empty(5)
            goal[:3] = error[:3]
            goal[3:] = across @ error[3:]
        else:
            error[3:] = turn_between(turned, rotation)
            angle = np.sqrt(np.sum(error[3:] ** 2))
            task, goal = jacobian, error
        distance = np.sqrt(np.sum(error[:3] ** 2))
        # The pull fades out, so that the last steps serve the target alone.
        pull = posture_pull * (1.0 - (step + 1.0) / steps)
        if distance < 1e-7 and angle < 1e-7 and (pull < 1e-3 or step >= steps // 2):
            break
        damping = min(0.05, 0.2 * (distance + angle)) + 1e-6
        change = joint_rates_for_twist(task, goal, pull * (posture - joints), damping)
        largest = np.max(np.abs(change))
        if largest > 0.3:
            change *= 0.3 / largest
        joints = np.minimum(np.maximum(joints + change, lower), upper)
    return joints, distance, angle


def _reach(
    robot: Robot,
    position: Array,
    rotation: Array,
    normal_only: bool,
    start: Array,
    posture: Array | None,
    lower: Array | None,
    upper: Array | None,
    posture_pull: float,
    steps: int,
) -> Reached:
    favourite = start if posture is None else posture
    lowest = np.array(robot.limits.lower_rad if lower is None else lower, dtype=np.float64)
    highest = np.array(robot.limits.upper_rad if upper is None else upper, dtype=np.float64)
    return Reached(
        *_search(
            robot.model,
            position,
            rotation,
            normal_only,
            start,
            favourite,
            lowest,
            highest,
            posture_pull,
            steps,
        )
    )


def reach_pose(
    robot: Robot,
    position: Array,
    rotation: Array,
    start: Array,
    posture: Array | None = None,
    *,
    lower: Array | None = None,
    upper: Array | None = None,
    posture_pull: float = 0.1,
    steps: int = 100,
) -> Reached:
    """Joint angles that put the paddle at `position` (3,) with `rotation` (3, 3).

    Parameters
    ----------
    start
        Joint angles to search from, shape (N,); the posture family found is the one near it.
    posture
        Angles that the spare degree of freedom is drawn to, shape (N,); `start` if None.
    lower, upper
        Position limits in rad, shape (N,); those of the robot if None.
    posture_pull
        Share of the way to `posture` taken per step, as far as the target leaves room.
    steps
        At most so many iterations. The result says how far it got; nothing is raised.
    """
    return _reach(robot, position, rotation, False, start, posture, lower, upper, posture_pull, steps)


def reach_blade(
    robot: Robot,
    position: Array,
    normal: Array,
    start: Array,
    posture: Array | None = None,
    *,
    lower: Array | None = None,
    upper: Array | None = None,
    posture_pull: float = 0.1,
    steps: int = 100,
) -> Reached:
    """Joint angles that put the blade's centre at `position` with the front face along `normal` (3,).

    For the back face pass the opposite of the direction that its face shall look to. How the handle stands
    about the normal is left to `posture`. Other parameters as in `reach_pose`.
    """
    rotation = np.zeros((3, 3))
    rotation[:, 1] = normal / np.linalg.norm(normal)
    return _reach(robot, position, rotation, True, start, posture, lower, upper, posture_pull, steps)
