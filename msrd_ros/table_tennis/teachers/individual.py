"""Teachers with a stroke of their own: between the population's strokes, or beside all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.guided_stroke import AttentionConfig, GuidedStroke, Intent
from msrd_ros.table_tennis.teachers.hit_solver import (
    HIGHEST_APEX_M,
    HitWish,
    angles_of,
    hit_of,
    rates_of,
    solve_hit,
)
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, PlannerConfig, face_sign, feed_path
from msrd_ros.table_tennis.teachers.style import Flaws, PopulationConfig, Style

_HIT_SLACK_S = 0.015
_PRACTICE_STEPS = 100
_FAMILIAR = 0.5
"""Residual per rad and per share of the speed limits by which a hit leaves the one that was practised."""


@dataclass(frozen=True)
class OwnStroke:
    """What a teacher does with the ball.

    Attributes
    ----------
    side
        Where balls are fed.
    spin_y_rad_s
        Right after the hit; positive is topspin.
    landing_x_m
        Where the ball bounces beyond the net.
    lowest_apex_m
        Of the ball's flight over the floor: a lob rises above what others do.
    """

    side: Side
    spin_y_rad_s: float
    landing_x_m: float = 0.75
    lowest_apex_m: float = 0.0

    @classmethod
    def between(cls, side: Side, first: Stroke, second: Stroke, share: float) -> OwnStroke:
        """A share of the way from one stroke's spin to another's."""
        config = PlannerConfig()
        spin = (1.0 - share) * config.spin(first) + share * config.spin(second)
        return cls(side, spin, config.landing_m[0])

    @classmethod
    def lob(cls, side: Side, apex_m: float = 1.95) -> OwnStroke:
        """High and without spin; the others' balls stay below `HIGHEST_APEX_M`."""
        return cls(side, 0.0, 0.8, apex_m)


class IndividualTeacher:
    """One synthetic subject of the population, with one stroke that is not among the planned.

    Parameters
    ----------
    stroke
        What the teacher shows.
    subject, seed
        Determine the style, as of `Teacher`.
    robot
        The arm that is led, of N joints; the default one if None.
    population
        How much teachers differ.
    """

    def __init__(
        self,
        stroke: OwnStroke,
        subject: int,
        seed: int,
        robot: Robot | None = None,
        population: PopulationConfig | None = None,
    ) -> None:
        self.stroke, self._robot = stroke, robot or default_robot()
        self._population = population or PopulationConfig()
        joints = self._robot.joint_count
        self.style = Style.draw(self._population, joints, np.random.default_rng((seed, subject)))
        self._scene = Scene().constants()
        self.intent = self._practise()

    def begin(self, rng: np.random.Generator) -> GuidedStroke:
        """Get ready for a stroke; `rng` draws everything that differs from one to the next."""
        usual, population = self.intent, self._population
        start = usual.ready + population.start_rad * np.clip(
            rng.standard_normal(self._robot.joint_count), -2.5, 2.5
        )
        return GuidedStroke(
            self._robot,
            Intent(usual.hit, usual.wish, start, usual.swing_s, usual.follow_s),
            Flaws.draw(self.style, population, rng),
            self.style.skill,
            self._scene,
            GuidanceConfig(),
            AttentionConfig(),
        )

    def _practise(self) -> Intent:
        """From the planned stroke of the nearest spin."""
        robot, wanted, config = self._robot, self.stroke, PlannerConfig()
        labels = [PaperLabel(wanted.side, stroke) for stroke in Stroke]
        label = min(labels, key=lambda each: abs(config.spin(each.stroke) - wanted.spin_y_rad_s))
        planned = planned_strokes(robot)[label]
        start = hit_of(
            planned.hit_time_s, planned.hit_position, planned.hit_velocity, robot.limits.speed_rad_s
        )
        offset_x, offset_y = self.style.landing_m[label]
        wish = HitWish(
            face=face_sign(wanted.side),
            spin_y=wanted.spin_y_rad_s,
            landing_x=wanted.landing_x_m + offset_x,
            landing_y=offset_y,
            time=planned.hit_time_s + self.style.hit_time_s[label],
            time_slack=_HIT_SLACK_S,
            highest_rate=0.85,
            posture=angles_of(start).copy(),
            posture_weight=_FAMILIAR,
            rates=rates_of(start).copy(),
            rates_weight=_FAMILIAR,
            lower=robot.planning.hit_lower_rad,
            upper=robot.planning.hit_upper_rad,
            lowest_apex=wanted.lowest_apex_m,
            highest_apex=max(HIGHEST_APEX_M, wanted.lowest_apex_m + 0.1),
        )
        path = feed_path(Feeder().nominal(wanted.side), self._scene)
        hit, _ = solve_hit(robot.model, start, wish, path, PATH_PERIOD_S, self._scene, _PRACTICE_STEPS)
        # From here on the own posture and rates are the familiar ones.
        wish = wish._replace(posture=angles_of(hit).copy(), rates=rates_of(hit).copy())
        swing_s = (planned.hit_time_s - planned.start_time_s) * self.style.swing
        ready = planned.start.position + self.style.ready_rad[label]
        return Intent(hit, wish, ready, swing_s, planned.follow_s)
