"""The three strokes of one side as one least-squares problem.

Unknowns are the ready pose and the three hits. Residuals are those of the hits (`hit_solver`), and those of
the motions from the ready pose through each hit to rest: within a share of the limits, clear of the table,
such that the arm takes them by itself when its paddle is led through them, and with a paddle that can still
move every way at the hit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from msrd_ros.core.compiled import njit
from msrd_ros.core.paddle import BLADE_RADIUS_M
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.dynamics import inverse_dynamics_into
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.quintic import follow_state, swing_state
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.collision_model import self_clearance
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.hit_solver import (
    HitWish,
    angles_of,
    hit_residuals,
    hit_size,
    rates_of,
    solve_hit,
)
from msrd_ros.table_tennis.teachers.impedance_guidance import leading_wrench

Array = NDArray[np.float64]

PATH_PERIOD_S = 0.005
PATH_ROWS = 260
"""A ball's path from its launch, 1.3 s."""

CLEAR_OF_TABLE_M = 0.86
"""Least height of the blade's edge near the table, 10 cm over its top."""

_DIRECTIONS = 6
"""Of the paddle: what a hand can lead."""
HAND_SHARE = 0.85
"""What of its strength the hand that leads the arm is asked for at most."""
_HAND_N = HAND_SHARE * GuidanceConfig().force_limit_n
_HAND_NM = HAND_SHARE * GuidanceConfig().torque_limit_nm
LEAST_ROOM_M = 0.04
"""Between parts of the arm, and to its stand."""
LEAST_SINGULAR_VALUE = 0.13
"""Of the paddle's Jacobian (m and rad alike) at a hit: with less, corrections of the hit cost large rates."""
_STROKES = tuple(Stroke)
_PHASES = np.linspace(0.0, 1.0, 13)[1:-1]

# What a residual of 1 stands for.
_RATE_EXCESS = 0.02
_DETOUR = 2.0
_HEIGHT_EXCESS_M = 0.01
_POSTURE_EXCESS_RAD = 0.02
_UNLED_TORQUE_NM = 2.0
_MIDDLE_PULL = 0.15
_HAND_EXCESS_N = 5.0
_HAND_EXCESS_NM = 0.5
_SINGULAR_EXCESS = 0.02

_TABLE_NEAR_X_M = -1.65


@dataclass(frozen=True)
class PlannerConfig:
    """What the planned strokes shall be like.

    Attributes
    ----------
    push_spin_rad_s, slice_spin_rad_s, topspin_spin_rad_s
        Spin about y right after the hit.
    landing_m
        Where the ball shall bounce on the far half, x and y; y counts towards the side of the stroke.
    hit_time_s, hit_time_slack_s
        Window of the hit, since the launch.
    highest_rate
        Largest joint rate at the hit, as a fraction of the speed limits.
    highest_swing_rate, highest_acceleration
        The same for the whole motion.
    swing_s, follow_s
        Duration from the ready pose to the hit, and from the hit to rest.
    searches
        Random postures tried.
    refined
        How many of the best families of postures are refined to a whole side.
    seed
        Of the search.
    """

    push_spin_rad_s: float = -6.0
    slice_spin_rad_s: float = -102.0
    topspin_spin_rad_s: float = 110.0
    landing_m: tuple[float, float] = (0.75, 0.0)
    hit_time_s: float = 0.94
    hit_time_slack_s: float = 0.02
    highest_rate: float = 0.80
    highest_swing_rate: float = 0.85
    highest_acceleration: float = 0.70
    swing_s: float = 0.42
    follow_s: float = 0.30
    searches: int = 120
    refined: int = 5
    seed: int = 1

    def spin(self, stroke: Stroke) -> float:
        """Spin about y that a stroke aims at, rad/s."""
        return {
            Stroke.PUSH: self.push_spin_rad_s,
            Stroke.SLICE: self.slice_spin_rad_s,
            Stroke.TOPSPIN: self.topspin_spin_rad_s,
        }[stroke]


def face_sign(side: Side) -> float:
    """+1 for the forehand face of the paddle, -1 for the backhand face."""
    return 1.0 if side is Side.FOREHAND else -1.0


def feed_path(feed: Feed, scene: NDArray[np.void]) -> Array:
    """Path of a fed ball from its launch, shape (PATH_ROWS, 9), rows PATH_PERIOD_S apart."""
    return ball_path(feed.state(), PATH_PERIOD_S, PATH_ROWS, scene)


def wish_for(
    robot: Robot, label: PaperLabel, config: PlannerConfig, posture: Array, posture_weight: float
) -> HitWish:
    """The hit that a stroke asks for, near to a posture (N,)."""
    return HitWish(
        face=face_sign(label.side),
        spin_y=config.spin(label.stroke),
        landing_x=config.landing_m[0],
        landing_y=-face_sign(label.side) * config.landing_m[1],
        time=config.hit_time_s,
        time_slack=config.hit_time_slack_s,
        highest_rate=config.highest_rate,
        posture=posture,
        posture_weight=posture_weight,
        rates=np.zeros(robot.joint_count),
        rates_weight=0.0,
        lower=robot.planning.hit_lower_rad,
        upper=robot.planning.hit_upper_rad,
    )


@njit(cache=True, nogil=True)
def _motion_residuals(
    arm: Arm,
    damping: Array,
    lower: Array,
    upper: Array,
    ready: Array,
    hit: Array,
    swing_s: float,
    follow_s: float,
    rate: float,
    acceleration: float,
    out: Array,
) -> int:
    """Residuals of the motion from the ready pose through a hit to rest; returns how many."""
    count, speed_limit, acceleration_limit = len(arm[0].speed), arm[0].speed, arm[0].acceleration
    rest = np.zeros(count)
    position, velocity = hit[1 : 1 + count], hit[1 + count : 1 + 2 * count] * speed_limit
    place = 0
    for phase in _PHASES:
        there, speed, change = swing_state(ready, rest, rest, position, velocity, swing_s, phase)
        for joint in range(count):
            out[place] = max(abs(speed[joint]) / speed_limit[joint] - rate, 0.0) / _RATE_EXCESS
            over = abs(change[joint]) / acceleration_limit[joint] - acceleration
            out[place + 1] = max(over, 0.0) / _RATE_EXCESS
            place += 2
        place = _leading_residuals(arm, damping, there, speed, change, out, place)
        there, speed, change = follow_state(position, velocity, follow_s, phase)
        place = _leading_residuals(arm, damping, there, speed, change, out, place)
    # Straight from the ready pose: what the swing has to travel beyond its run-up costs a little.
    out[place : place + count] = (position - ready - 0.5 * swing_s * velocity) / (
        _DETOUR * swing_s * speed_limit
    )
    place += count
    out[place] = singular_residual(arm, position)
    place += 1
    end, _, _ = follow_state(position, velocity, follow_s, 1.0)
    out[place] = _room_residual(arm, end)
    out[place + 1 : place + 1 + count] = _posture_excess(end, lower, upper)
    return place + 1 + count


@njit(cache=True, nogil=True)
def _leading_residuals(
    arm: Arm, damping: Array, joints: Array, rates: Array, accelerations: Array, out: Array, place: int
) -> int:
    """Residuals of a moment in which the arm is led: room, and what the hand has to give."""
    out[place] = _room_residual(arm, joints)
    out[place + 1] = _unled_torque(arm, damping, joints, rates, accelerations) / _UNLED_TORQUE_NM
    wrench = leading_wrench(arm, joints, rates, accelerations, damping)
    out[place + 2] = max(np.sqrt(np.sum(wrench[:3] ** 2)) - _HAND_N, 0.0) / _HAND_EXCESS_N
    out[place + 3] = max(np.sqrt(np.sum(wrench[3:] ** 2)) - _HAND_NM, 0.0) / _HAND_EXCESS_NM
    return place + 4


@njit(cache=True, nogil=True)
def _unled_torque(arm: Arm, damping: Array, joints: Array, rates: Array, accelerations: Array) -> float:
    """Torque in Nm along the arm's spare degree of freedom: what a hand at the paddle cannot give.

    A motion without it is the one that the arm takes by itself when the paddle is led through it. An arm of
    six joints has no such freedom; of an arm with two or more only that of its first joints is looked at.
    """
    count = len(arm[0].speed)
    if count <= _DIRECTIONS:
        return 0.0
    jacobian = paddle_jacobian(arm, joints)
    spare = np.zeros(count)
    minor = np.empty((_DIRECTIONS, _DIRECTIONS))
    for joint in range(_DIRECTIONS + 1):
        minor[:, :joint] = jacobian[:, :joint]
        minor[:, joint:] = jacobian[:, joint + 1 : _DIRECTIONS + 1]
        spare[joint] = np.linalg.det(minor) * (1.0 - 2.0 * (joint % 2))
    torque = np.empty(count)
    inverse_dynamics_into(arm, joints, rates, accelerations, 0.0, torque)
    length = np.sqrt(np.sum(spare * spare)) + 1e-12
    effort: float = np.sum(spare * (torque + damping * rates)) / length
    return effort


@njit(cache=True, nogil=True)
def singular_residual(arm: Arm, joints: Array) -> float:
    """How near to a singular posture joint angles (N,) are: 0 where the paddle can move every way."""
    least: float = np.linalg.svd(paddle_jacobian(arm, joints))[1][-1]
    return max(LEAST_SINGULAR_VALUE - least, 0.0) / _SINGULAR_EXCESS


@njit(cache=True, nogil=True)
def _room_residual(arm: Arm, joints: Array) -> float:
    """Blade's lower edge less than 10 cm over the table, where it may be near; or arm too near to arm."""
    centre, rotation = paddle_pose(arm, joints)
    edge = centre[2] - BLADE_RADIUS_M * np.sqrt(max(1.0 - rotation[2, 1] ** 2, 0.0))
    low = max(CLEAR_OF_TABLE_M - edge, 0.0) if centre[0] > _TABLE_NEAR_X_M else 0.0
    return (low + max(LEAST_ROOM_M - self_clearance(arm, joints), 0.0)) / _HEIGHT_EXCESS_M


@njit(cache=True, nogil=True)
def _posture_excess(joints: Array, lower: Array, upper: Array) -> Array:
    """Beyond the postures that look like a table tennis player."""
    excess: Array = np.maximum(joints - upper, 0.0) + np.minimum(joints - lower, 0.0)
    return excess / _POSTURE_EXCESS_RAD


class SideProblem:
    """Ready pose and three hits of one side as one vector of N + 3 (1 + 2 N) unknowns."""

    def __init__(
        self, robot: Robot, side: Side, config: PlannerConfig, path: Array, scene: NDArray[np.void]
    ) -> None:
        self.robot = robot
        self.config, self.path, self.scene = config, path, scene
        self.labels = [PaperLabel(side, stroke) for stroke in _STROKES]
        self._size = hit_size(robot.joint_count)
        self._buffer = np.empty(4000)

    def start(self, push: Array) -> tuple[Array, float]:
        """First guess from the hit of a push; and its cost."""
        hits, cost = [], 0.0
        for label in self.labels:
            wish = wish_for(self.robot, label, self.config, angles_of(push).copy(), 0.3)
            hit, rest = solve_hit(self.robot.model, push, wish, self.path, PATH_PERIOD_S, self.scene, 60)
            hits.append(hit)
            cost += rest
        half_s, speed = 0.5 * self.config.swing_s, self.robot.limits.speed_rad_s
        run_up = [angles_of(hit) - half_s * rates_of(hit) * speed for hit in hits]
        return np.concatenate([np.mean(run_up, axis=0), *hits]), cost

    def residuals(self, unknowns: Array) -> Array:
        """All residuals, shape (R,)."""
        config, out, robot = self.config, self._buffer, self.robot
        planning, damping, count = robot.planning, robot.floating.joint_damping_nm_s, robot.joint_count
        ready = unknowns[:count]
        place = 0
        for index, label in enumerate(self.labels):
            hit = self.hit(unknowns, index)
            wish = wish_for(robot, label, config, ready, 0.1)
            place += hit_residuals(robot.model, hit, wish, self.path, PATH_PERIOD_S, self.scene, out[place:])
            place += _motion_residuals(
                robot.model,
                damping,
                planning.rest_lower_rad,
                planning.rest_upper_rad,
                ready,
                hit,
                config.swing_s,
                config.follow_s,
                config.highest_swing_rate,
                config.highest_acceleration,
                out[place:],
            )
        out[place : place + count] = _posture_excess(ready, planning.rest_lower_rad, planning.rest_upper_rad)
        # Not the last joint: how the handle is held is the hit's own.
        out[place + count : place + 2 * count - 1] = (ready - planning.middle_rad)[:-1] * _MIDDLE_PULL
        return out[: place + 2 * count - 1].copy()

    def hit(self, unknowns: Array, index: int) -> Array:
        """The hit (1 + 2 N,) of one of the three strokes."""
        first = self.robot.joint_count + self._size * index
        return unknowns[first : first + self._size]

    def solve(self, start: Array, evaluations: int = 150) -> tuple[Array, float]:
        """Refine a first guess; returns the unknowns and the cost."""
        count = self.robot.joint_count
        one = np.r_[0.02, np.full(2 * count, 0.3)]
        scale = np.concatenate([np.full(count, 0.3), np.tile(one, len(_STROKES))])
        found = least_squares(self.residuals, start, x_scale=scale, max_nfev=evaluations)
        return found.x, float(found.cost)
