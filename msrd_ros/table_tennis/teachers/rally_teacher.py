"""A teacher for rallies: plans a stroke to whatever ball comes, back to where the partner waits for it.

Like the other synthetic teachers it plans by `solve_hit` from its practised stroke; unlike them it is told
the ball's true state when it sets out. It shows policies what to do and never plays in a rally itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.quintic import JointStroke, stroke_from_rest
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.paper import PaperLabel
from msrd_ros.table_tennis.teachers.hit_solver import (
    TIME,
    HitWish,
    angles_of,
    hit_of,
    rates_of,
    solve_hit,
)
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, PATH_ROWS, PlannerConfig, face_sign

Array = NDArray[np.float64]

SOUND_COST = 2.0
"""Of a hit that does what is wanted of it."""
_STEPS = 60


@dataclass(frozen=True)
class RallyTeacherConfig:
    """What the teacher's strokes are like.

    Attributes
    ----------
    landing_m
        Where balls shall bounce beyond the net: x, and y towards the partner's same side (across the table).
    highest_apex_m
        Of the ball's centre over the floor: lower balls come faster and leave the partner less time.
    hits_x_m
        About where balls are met: the first of these places where a ball can be met well.
    hit_time_slack_s
        How far the hit may be from there.
    familiar
        Residual per rad and per share of the speed limits by which a hit leaves the practised one.
    swing_s, follow_s
        From the ready pose to the hit, and from there to rest.
    """

    landing_m: tuple[float, float] = (0.75, 0.17)
    highest_apex_m: float = 1.25
    hits_x_m: tuple[float, ...] = (-1.57, -1.45, -1.69, -1.33)
    hit_time_slack_s: float = 0.05
    familiar: float = 0.5
    swing_s: float = 0.42
    follow_s: float = 0.30


class RallyTeacher:
    """Plans strokes of one strategy against balls that come any way.

    Parameters
    ----------
    label
        The stroke that is played.
    robot
        The arm, of N joints.
    config
        What its strokes are like.
    """

    def __init__(self, label: PaperLabel, robot: Robot, config: RallyTeacherConfig | None = None) -> None:
        self.label, self.robot = label, robot
        self.config = config or RallyTeacherConfig()
        self._scene = Scene().constants()
        self._practised = planned_strokes(robot)[label]
        practised = self._practised
        self._hit = hit_of(
            practised.hit_time_s, practised.hit_position, practised.hit_velocity, robot.limits.speed_rad_s
        )

    @property
    def ready_pose(self) -> Array:
        """Where the arm waits, shape (N,), rad."""
        return self._practised.start.position

    @property
    def landing_m(self) -> Array:
        """Where it wants its balls to bounce, shape (2,), m."""
        depth_m, across_m = self.config.landing_m
        return np.array([depth_m, face_sign(self.label.side) * across_m])

    def plan(self, incoming: Array) -> tuple[JointStroke, float]:
        """A stroke to one ball.

        Parameters
        ----------
        incoming
            The ball when it sets out, shape (9,), in the arm's frame.

        Returns
        -------
        stroke
            Times count from there.
        cost
            Of the hit: half the sum of its squared residuals; well above `SOUND_COST`, no stroke does it.
        """
        path = ball_path(incoming, PATH_PERIOD_S, PATH_ROWS, self._scene)
        best = None
        for hit_x_m in self.config.hits_x_m:
            found = self._meet(path, _time_at(path, hit_x_m))
            if best is None or found[1] < best[1]:
                best = found
            if best[1] < SOUND_COST:
                break
        assert best is not None
        return best

    def _meet(self, path: Array, time_s: float) -> tuple[JointStroke, float]:
        """A stroke that meets a ball on its path (T, 9) at about a moment; as `plan`."""
        config, robot = self.config, self.robot
        start = self._hit.copy()
        start[TIME] = time_s
        face = face_sign(self.label.side)
        wish = HitWish(
            face=face,
            spin_y=PlannerConfig().spin(self.label.stroke),
            landing_x=float(self.landing_m[0]),
            landing_y=float(self.landing_m[1]),
            time=time_s,
            time_slack=config.hit_time_slack_s,
            highest_rate=0.85,
            posture=angles_of(self._hit).copy(),
            posture_weight=config.familiar,
            rates=rates_of(self._hit).copy(),
            rates_weight=config.familiar,
            lower=robot.planning.hit_lower_rad,
            upper=robot.planning.hit_upper_rad,
            highest_apex=config.highest_apex_m,
        )
        hit, cost = solve_hit(robot.model, start, wish, path, PATH_PERIOD_S, self._scene, _STEPS)
        stroke = stroke_from_rest(
            self.ready_pose,
            float(hit[TIME]),
            angles_of(hit).copy(),
            rates_of(hit) * robot.limits.speed_rad_s,
            swing_s=config.swing_s,
            follow_s=config.follow_s,
        )
        return stroke, float(cost)


def _time_at(path: Array, x_m: float) -> float:
    """When a ball passes x on its path (T, 9), s; the path's last moment if it never does."""
    passed = np.flatnonzero(path[:, 0] < x_m)
    return float(passed[0] if len(passed) else len(path) - 1) * PATH_PERIOD_S
