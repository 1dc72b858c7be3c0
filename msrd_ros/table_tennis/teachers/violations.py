"""What of a pose or a motion an arm cannot do: which limit, of which joint, and by how much."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.dynamics import inverse_dynamics
from msrd_ros.robots.inverse_kinematics import Reached, reach_pose
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.quintic import JointState
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import turn_between
from msrd_ros.table_tennis.arm.collision_model import MARGIN_M, clearance, obstacle, self_clearance
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.impedance_guidance import leading_wrench

Array = NDArray[np.float64]

_REACHED_M = 1e-3
_REACHED_RAD = 5e-3
"""A pose that is missed by less counts as reached."""
_ROUNDING = 1e-9
_RADIAN_M = 0.1
"""A pose that is turned wrongly by one radian is as bad as one that is so far away."""


class Limit(StrEnum):
    """What cannot be passed."""

    REACH = "reach"
    POSITION = "position"
    SPEED = "speed"
    """Of an arm that is led by the hand: from there on its brakes work against the hand."""
    ACCELERATION = "acceleration"
    TORQUE = "torque"
    TABLE = "room to table and floor"
    ARM = "room between parts of the arm"
    HAND_FORCE = "force of the hand"
    HAND_TORQUE = "torque of the hand"


@dataclass(frozen=True)
class Violation:
    """One limit that a pose or a motion does not keep to, where it is worst.

    Attributes
    ----------
    limit
        Which one.
    excess
        By how much it is passed, in `unit`; of `Limit.REACH` by how much the pose is missed.
    unit
        Of `excess`.
    joint
        Whose limit; empty where it is the arm's or the hand's.
    time_s
        When, since the ball's launch; NaN of a pose.
    ghost
        The pose that it happens at or nearest to in time; empty if there is none.
    """

    limit: Limit
    excess: float
    unit: str
    joint: str = ""
    time_s: float = math.nan
    ghost: str = ""

    def __str__(self) -> str:
        who = f"{self.joint}: " if self.joint else ""
        when = "" if math.isnan(self.time_s) else f" {self.time_s:.3f} s after the launch"
        where = f", {self.ghost}" if self.ghost else ""
        over = "missed" if self.limit is Limit.REACH else "passed"
        return f"{who}{self.limit} {over} by {self.excess:.3g} {self.unit}{when}{where}"


def reach(
    robot: Robot, position: Array, rotation: Array, starts: list[Array]
) -> tuple[Array, list[Violation]]:
    """Joint angles within the limits that put the paddle in a pose or next to it, and what keeps it off.

    Parameters
    ----------
    position, rotation
        Of the paddle, shape (3,) in m and (3, 3).
    starts
        Joint angles (N,) to search from, the favourite first: the first that gets there counts.

    Returns
    -------
    tuple
        Joint angles (N,), and no violation if they reach the pose. A pose that is reached beyond some joints'
        limits names these; any other says by how far it is missed.
    """
    limits = robot.limits
    missed = []
    for start in starts:
        found = _nearest_pose(robot, position, rotation, start, limits.lowest_rad, limits.highest_rad)
        if _is_reached(found):
            return found.joint_position, []
        missed.append(found)
    nearest = min(missed, key=lambda each: each.distance_m + _RADIAN_M * each.angle_rad)
    joints = nearest.joint_position
    lower, upper = limits.lowest_rad - math.pi, limits.highest_rad + math.pi
    beyond = _nearest_pose(robot, position, rotation, joints, lower, upper)
    if _is_reached(beyond):
        angles = beyond.joint_position
        over = np.maximum(limits.lowest_rad - angles, angles - limits.highest_rad)
        return joints, [
            Violation(Limit.POSITION, float(excess), "rad", name)
            for name, excess in zip(robot.joint_names, over, strict=True)
            if excess > 0.0
        ]
    misses = ((nearest.distance_m, _REACHED_M, "m"), (nearest.angle_rad, _REACHED_RAD, "rad"))
    return joints, [Violation(Limit.REACH, miss, unit) for miss, enough, unit in misses if miss >= enough]


def _is_reached(found: Reached) -> bool:
    return found.distance_m < _REACHED_M and found.angle_rad < _REACHED_RAD


def _nearest_pose(
    robot: Robot, position: Array, rotation: Array, start: Array, lower: Array, upper: Array
) -> Reached:
    """As `reach_pose`, and how far it is missed by the very angles that are given back."""
    joints = reach_pose(robot, position, rotation, start, lower=lower, upper=upper).joint_position
    here, turned = paddle_pose(robot.model, joints)
    distance_m, turn = np.linalg.norm(position - here), turn_between(turned, rotation)
    return Reached(joints, float(distance_m), float(np.linalg.norm(turn)))


def check_pose(
    robot: Robot, position: Array, rotation: Array, near: Array, table: Table | None = None
) -> tuple[Array, list[Violation]]:
    """Whether the paddle may be led to a pose: what a person sees who drags it.

    Parameters
    ----------
    position, rotation
        Of the paddle, shape (3,) in m and (3, 3).
    near
        Where the arm is, shape (N,), rad.
    table
        The standard one if None.

    Returns
    -------
    tuple
        The joint angles (N,) nearest to the pose, and what is wrong with it.
    """
    joints, found = reach(robot, position, rotation, [near])
    still = np.zeros((1, robot.joint_count))
    states = JointState(joints[None], still, still)
    crowded = [each for each in check_motion(robot, np.full(1, np.nan), states, {}, table) if not each.joint]
    return joints, found + crowded


def check_motion(
    robot: Robot,
    times_s: Array,
    states: JointState,
    moments: Mapping[str, float],
    table: Table | None = None,
    grip: GuidanceConfig | None = None,
) -> list[Violation]:
    """All limits that a motion does not keep to, each where it is worst, in the order of time.

    Parameters
    ----------
    times_s
        Shape (T,).
    states
        Of the joints, shape (T, N) each.
    moments
        Times of named poses, s.
    table, grip
        The standard ones if None.
    """
    limits, grip = robot.limits, grip or GuidanceConfig()
    speed_limit = robot.floating.brake_from * limits.speed_rad_s
    torque, crowd, hand = _loads(
        robot.model,
        *states,
        np.array(robot.floating.joint_damping_nm_s),
        obstacle(table or Table()),
    )
    of_joints = (
        (
            Limit.POSITION,
            "rad",
            np.maximum(limits.lowest_rad - states.position, states.position - limits.highest_rad),
        ),
        (Limit.SPEED, "rad/s", np.abs(states.velocity) - speed_limit),
        (Limit.ACCELERATION, "rad/s^2", np.abs(states.acceleration) - limits.acceleration_rad_s2),
        (Limit.TORQUE, "Nm", np.abs(torque) - limits.torque_nm),
    )
    of_arm = (
        (Limit.TABLE, "m", MARGIN_M - crowd[:, 0]),
        (Limit.ARM, "m", -crowd[:, 1]),
        (Limit.HAND_FORCE, "N", hand[:, 0] - grip.force_limit_n),
        (Limit.HAND_TORQUE, "Nm", hand[:, 1] - grip.torque_limit_nm),
    )
    found = []
    for limit, unit, excesses in of_joints:
        for index, joint in enumerate(robot.joint_names):
            found += _worst(limit, unit, joint, excesses[:, index], times_s)
    for limit, unit, excess in of_arm:
        found += _worst(limit, unit, "", excess, times_s)
    named = [replace(each, ghost=_nearest(moments, each.time_s)) for each in found]
    return sorted(named, key=lambda each: each.time_s)


def _worst(limit: Limit, unit: str, joint: str, excess: Array, times_s: Array) -> list[Violation]:
    row = int(excess.argmax())
    if excess[row] <= _ROUNDING:
        return []
    return [Violation(limit, float(excess[row]), unit, joint, float(times_s[row]))]


def _nearest(moments: Mapping[str, float], time_s: float) -> str:
    return min(moments, key=lambda name: abs(moments[name] - time_s), default="")


@njit(cache=True, nogil=True)
def _loads(
    arm: Arm, position: Array, velocity: Array, acceleration: Array, damping: Array, table: Array
) -> tuple[Array, Array, Array]:
    """Of T states: torques (T, N) in Nm, room to table and to itself (T, 2) in m, hand (T, 2) in N and Nm."""
    rows, count = position.shape
    torque, crowd, hand = np.empty((rows, count)), np.empty((rows, 2)), np.empty((rows, 2))
    for row in range(rows):
        joints, rates, changes = position[row], velocity[row], acceleration[row]
        torque[row] = inverse_dynamics(arm, joints, rates, changes) + arm[0].friction * rates
        crowd[row, 0] = clearance(arm, joints, table)
        crowd[row, 1] = self_clearance(arm, joints)
        wrench = leading_wrench(arm, joints, rates, changes, damping)
        hand[row, 0] = np.sqrt(np.sum(wrench[:3] ** 2))
        hand[row, 1] = np.sqrt(np.sum(wrench[3:] ** 2))
    return torque, crowd, hand
