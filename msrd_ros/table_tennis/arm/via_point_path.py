"""Finds a path for an arm between two strokes: not through the table, the floor, the stand or the arm itself.

Joints that all move at once do not take the straight line between two postures, so every path is tried out
with the very law by which it will be commanded, and the arm's clearance is looked at after each period.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.robots.limits import JointReference, shape_command, velocity_towards
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.collision_model import MARGIN_M, clearance, obstacle, self_clearance
from msrd_ros.table_tennis.ball.scene import Table

TRAVEL_SHARE = 0.5
"""Of the speed limits, on the way between two strokes."""
PASSING_TOLERANCE_RAD = 0.05
"""So near to a pose on the path the arm turns towards the next."""

_ENOUGH_M = MARGIN_M + 0.01
"""With less clearance the driver may hold the arm back."""
_LIFTS_RAD = (0.3, 0.6, 0.9)
_LONGEST_S = 8.0
_CLOSE_RAD = 0.01

Pose = NDArray[np.float64]
_TABLE = obstacle(Table())


def room(robot: Robot, pose: Pose) -> float:
    """Least distance in m of the arm at `pose` (N,) from table, floor, stand and itself."""
    pose = pose.copy()  # one that nobody can write to would be compiled for anew
    return min(clearance(robot.model, pose, _TABLE), self_clearance(robot.model, pose))


def follow_path(
    robot: Robot,
    reference: JointReference,
    path: Sequence[Pose],
    goal: Pose,
    period_s: float,
    speed_fraction: float = TRAVEL_SHARE,
) -> tuple[JointReference, Sequence[Pose]]:
    """Next reference on the path past the poses of `path` to `goal`, and what is left of the path."""
    target = path[0] if path else goal
    wanted = velocity_towards(robot, reference, target, period_s, speed_fraction)
    moved = shape_command(robot, reference, wanted, period_s)
    passed = path and np.abs(moved.position - target).max() < PASSING_TOLERANCE_RAD
    return moved, path[1:] if passed else path


def find_path(
    robot: Robot,
    reference: JointReference,
    goal: Pose,
    known: Sequence[Pose] = (),
    speed_fraction: float = TRAVEL_SHARE,
) -> list[Pose]:
    """Poses to pass between a reference and `goal`, best none.

    Parameters
    ----------
    robot
        Whose arm, of N joints.
    reference
        Where the arm is, and how it moves.
    goal
        Where it shall come to rest, shape (N,), rad.
    known
        Poses that may be worth passing, shape (N,) each: such as where the stroke began.
    speed_fraction
        Of the speed limits, at which it will be followed.

    Returns
    -------
    list of arrays
        Of the first path that keeps clear of all; of the one that keeps clearest if none does.
    """
    best: list[Pose] = []
    best_m = -np.inf
    for path in _paths(robot, reference.position, goal, known):
        least_m = _least_clearance(robot, reference, path, goal, speed_fraction)
        if least_m > best_m:
            best, best_m = path, least_m
        if best_m > _ENOUGH_M:
            break
    return best


def _paths(robot: Robot, start: Pose, goal: Pose, known: Sequence[Pose]) -> Iterator[list[Pose]]:
    """Ways in the order in which they are tried."""
    yield []
    for pose in known:
        yield [pose]
    for lift in _LIFTS_RAD:
        yield [_lifted(robot, start, lift), _lifted(robot, goal, lift)]
    yield [robot.home_rad]
    for lift in _LIFTS_RAD:
        yield [_lifted(robot, start, lift), robot.home_rad]
    for pose in known:
        yield [pose, robot.home_rad]


def _lifted(robot: Robot, pose: Pose, lift: float) -> Pose:
    joint, direction = robot.lift
    lifted = pose.copy()
    lifted[joint] += direction * lift
    return np.clip(lifted, robot.limits.lowest_rad, robot.limits.highest_rad)


def _least_clearance(
    robot: Robot, reference: JointReference, path: Sequence[Pose], goal: Pose, speed_fraction: float
) -> float:
    """Least clearance in m after any period on the path; of a goal that is not reached in time, -inf."""
    # Nobody can help where the arm is now or that the goal is where it is.
    fixed_m = min(room(robot, reference.position), room(robot, goal)) - 1e-3
    least_m = np.inf
    for _ in range(round(_LONGEST_S / CONTROL_PERIOD_S)):
        reference, path = follow_path(robot, reference, path, goal, CONTROL_PERIOD_S, speed_fraction)
        least_m = min(least_m, room(robot, reference.position))
        if not path and np.abs(reference.position - goal).max() < _CLOSE_RAD:
            return least_m if least_m < fixed_m else np.inf
    return -np.inf
