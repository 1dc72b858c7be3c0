"""The three strokes of one side as one least-squares problem.

Unknowns are the ready pose and the three hits. Residuals are those of the hits (`hit_solver`), and those of
the motions from the ready pose through each hit to rest: within a share of the limits, clear of the table,
and such that the arm takes them by itself when its paddle is led through them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

from msrd_ros.contract.labels import Side, StrategyLabel, Stroke
from msrd_ros.robots.dynamics import inverse_dynamics_into
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.limits import ACCELERATION_LIMIT_RAD_S2
from msrd_ros.robots.quintic import follow_state, swing_state
from msrd_ros.robots.sawyer import SPEED_LIMIT_RAD_S
from msrd_ros.robots.sawyer_description import BLADE_RADIUS_M
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.hit_solver import (
    HIT_SIZE,
    POSITION,
    RATE,
    HitWish,
    hit_residuals,
    solve_hit,
)

Array = NDArray[np.float64]

PATH_PERIOD_S = 0.005
PATH_ROWS = 260
"""A ball's path from its launch, 1.3 s."""

CLEAR_OF_TABLE_M = 0.86
"""Least height of the blade's edge near the table, 10 cm over its top."""

_SPEED_LIMIT = SPEED_LIMIT_RAD_S.copy()
_ACCELERATION_LIMIT = ACCELERATION_LIMIT_RAD_S2.copy()
_TEACH_DAMPING = np.array(GuidanceConfig().joint_damping_nm_s)
_STROKES = tuple(Stroke)
_PHASES = np.linspace(0.0, 1.0, 13)[1:-1]

# What a residual of 1 stands for.
_RATE_EXCESS = 0.02
_DETOUR = 2.0
_HEIGHT_EXCESS_M = 0.01
_POSTURE_EXCESS_RAD = 0.02
_UNLED_TORQUE_NM = 2.0
_MIDDLE_PULL = 0.15

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


def wish_for(label: StrategyLabel, config: PlannerConfig, posture: Array, posture_weight: float) -> HitWish:
    """The hit that a stroke asks for, near to a posture (7,)."""
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
        rates=np.zeros(7),
        rates_weight=0.0,
    )


@njit(cache=True, nogil=True)
def _motion_residuals(
    ready: Array, hit: Array, swing_s: float, follow_s: float, rate: float, acceleration: float, out: Array
) -> int:
    """Residuals of the motion from the ready pose through a hit to rest; returns how many."""
    rest = np.zeros(7)
    position, velocity = hit[1:8], hit[8:15] * _SPEED_LIMIT
    place = 0
    for phase in _PHASES:
        there, speed, change = swing_state(ready, rest, rest, position, velocity, swing_s, phase)
        for joint in range(7):
            out[place] = max(abs(speed[joint]) / _SPEED_LIMIT[joint] - rate, 0.0) / _RATE_EXCESS
            over = abs(change[joint]) / _ACCELERATION_LIMIT[joint] - acceleration
            out[place + 1] = max(over, 0.0) / _RATE_EXCESS
            place += 2
        out[place] = _table_residual(there)
        out[place + 1] = _unled_torque(there, speed, change) / _UNLED_TORQUE_NM
        place += 2
        there, speed, change = follow_state(position, velocity, follow_s, phase)
        out[place] = _unled_torque(there, speed, change) / _UNLED_TORQUE_NM
        place += 1
    # Straight from the ready pose: what the swing has to travel beyond its run-up costs a little.
    out[place : place + 7] = (position - ready - 0.5 * swing_s * velocity) / (
        _DETOUR * swing_s * _SPEED_LIMIT
    )
    place += 7
    end, _, _ = follow_state(position, velocity, follow_s, 1.0)
    out[place] = _table_residual(end)
    out[place + 1 : place + 8] = _posture_excess(end)
    return place + 8


@njit(cache=True, nogil=True)
def _unled_torque(joints: Array, rates: Array, accelerations: Array) -> float:
    """Torque in Nm along the arm's spare degree of freedom: what a hand at the paddle cannot give.

    A motion without it is the one that the arm takes by itself when the paddle is led through it.
    """
    jacobian = paddle_jacobian(joints)
    spare = np.empty(7)
    minor = np.empty((6, 6))
    for joint in range(7):
        minor[:, :joint] = jacobian[:, :joint]
        minor[:, joint:] = jacobian[:, joint + 1 :]
        spare[joint] = np.linalg.det(minor) * (1.0 - 2.0 * (joint % 2))
    torque = np.empty(7)
    inverse_dynamics_into(joints, rates, accelerations, 0.0, torque)
    length = np.sqrt(np.sum(spare * spare)) + 1e-12
    effort: float = np.sum(spare * (torque + _TEACH_DAMPING * rates)) / length
    return effort


@njit(cache=True, nogil=True)
def _table_residual(joints: Array) -> float:
    """Blade's lower edge less than 10 cm over the table, where the table may be near."""
    centre, rotation = paddle_pose(joints)
    edge = centre[2] - BLADE_RADIUS_M * np.sqrt(max(1.0 - rotation[2, 1] ** 2, 0.0))
    return max(CLEAR_OF_TABLE_M - edge, 0.0) / _HEIGHT_EXCESS_M if centre[0] > _TABLE_NEAR_X_M else 0.0


@njit(cache=True, nogil=True)
def _posture_excess(joints: Array) -> Array:
    """Beyond the postures that look like a table tennis player."""
    upper = np.array([1.25, 0.85, 2.75, 2.75, 2.8, 2.8, 4.0])
    lower = np.array([-1.25, -1.85, -2.75, -2.75, -2.8, -2.8, -4.0])
    excess: Array = np.maximum(joints - upper, 0.0) + np.minimum(joints - lower, 0.0)
    return excess / _POSTURE_EXCESS_RAD


class SideProblem:
    """Ready pose and three hits of one side as one vector of 7 + 3 * 15 unknowns."""

    def __init__(self, side: Side, config: PlannerConfig, path: Array, scene: NDArray[np.void]) -> None:
        self.config, self.path, self.scene = config, path, scene
        self.labels = [StrategyLabel(side, stroke) for stroke in _STROKES]
        self._buffer = np.empty(1000)

    def start(self, push: Array) -> tuple[Array, float]:
        """First guess from the hit of a push; and its cost."""
        hits, cost = [], 0.0
        for label in self.labels:
            wish = wish_for(label, self.config, push[POSITION].copy(), 0.3)
            hit, rest = solve_hit(push, wish, self.path, PATH_PERIOD_S, self.scene, 60)
            hits.append(hit)
            cost += rest
        run_up = [hit[POSITION] - 0.5 * self.config.swing_s * hit[RATE] * _SPEED_LIMIT for hit in hits]
        return np.concatenate([np.mean(run_up, axis=0), *hits]), cost

    def residuals(self, unknowns: Array) -> Array:
        """All residuals, shape (R,)."""
        config, out = self.config, self._buffer
        ready = unknowns[:7]
        place = 0
        for index, label in enumerate(self.labels):
            hit = self.hit(unknowns, index)
            wish = wish_for(label, config, ready, 0.1)
            place += hit_residuals(hit, wish, self.path, PATH_PERIOD_S, self.scene, out[place:])
            place += _motion_residuals(
                ready,
                hit,
                config.swing_s,
                config.follow_s,
                config.highest_swing_rate,
                config.highest_acceleration,
                out[place:],
            )
        out[place : place + 7] = _posture_excess(ready)
        out[place + 7 : place + 13] = ready[:6] * _MIDDLE_PULL
        return out[: place + 13].copy()

    def hit(self, unknowns: Array, index: int) -> Array:
        """The hit (15,) of one of the three strokes."""
        return unknowns[7 + HIT_SIZE * index : 7 + HIT_SIZE * (index + 1)]

    def solve(self, start: Array, evaluations: int = 150) -> tuple[Array, float]:
        """Refine a first guess; returns the unknowns and the cost."""
        scale = np.concatenate([np.full(7, 0.3), np.tile(np.r_[0.02, np.full(14, 0.3)], len(_STROKES))])
        found = least_squares(self.residuals, start, x_scale=scale, max_nfev=evaluations)
        return found.x, float(found.cost)
