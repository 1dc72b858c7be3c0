"""A population of synthetic teachers: each with their own strokes, timing, ready poses and slips.

A teacher is made from the seed of the population and an index, knows the feeder and the arm from practice,
and leads the paddle by the hand. All that a teacher learns of a particular ball comes from the camera.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.guided_stroke import AttentionConfig, GuidedStroke, Intent
from msrd_ros.table_tennis.teachers.hit_solver import TIME, HitWish, angles_of, hit_of, rates_of, solve_hit
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, PlannerConfig, face_sign, feed_path
from msrd_ros.table_tennis.teachers.study_design import subject_name
from msrd_ros.table_tennis.teachers.style import Flaws, PopulationConfig, Style

Array = NDArray[np.float64]

_HIT_SLACK_S = 0.015
_POSTURE_WEIGHT = 0.5
_RATES_WEIGHT = 0.5
_PRACTICE_STEPS = 60


class Teacher:
    """One synthetic subject.

    Parameters
    ----------
    subject
        Index from 0; together with `seed` it determines all style.
    seed
        Of the population.
    population
        How much teachers differ.
    scene, feeder
        What the teacher has practised with.
    grip
        The hand's grip, as the simulator has it.
    attention
        How the teacher reacts to the ball.
    robot
        The arm that is led, of N joints.
    """

    def __init__(
        self,
        subject: int,
        seed: int,
        population: PopulationConfig | None = None,
        scene: Scene | None = None,
        feeder: Feeder | None = None,
        grip: GuidanceConfig | None = None,
        attention: AttentionConfig | None = None,
        robot: Robot | None = None,
    ) -> None:
        self._robot = robot or default_robot()
        self.subject = subject
        self.population = population or PopulationConfig()
        self.style = Style.draw(
            self.population, self._robot.joint_count, np.random.default_rng((seed, subject))
        )
        self._scene = (scene or Scene()).constants()
        self._feeder = feeder or Feeder()
        self._grip = grip or GuidanceConfig()
        self._attention = attention or AttentionConfig()
        self._intents: dict[PaperLabel, Intent] = {}

    @property
    def name(self) -> str:
        """For people and folders."""
        return subject_name(self.subject)

    def begin(self, label: PaperLabel, rng: np.random.Generator) -> GuidedStroke:
        """Get ready for a stroke.

        Parameters
        ----------
        label
            What the teacher is asked to show.
        rng
            Draws everything that differs from stroke to stroke.
        """
        usual = self.intent(label)
        start = usual.ready + self.population.start_rad * np.clip(
            rng.standard_normal(self._robot.joint_count), -2.5, 2.5
        )
        flaws = Flaws.draw(self.style, self.population, rng)
        intent = Intent(usual.hit, usual.wish, start, usual.swing_s, usual.follow_s)
        return GuidedStroke(
            self._robot, intent, flaws, self.style.skill, self._scene, self._grip, self._attention
        )

    def intent(self, label: PaperLabel) -> Intent:
        """What the teacher usually means to do: the planned stroke, made their own."""
        if label not in self._intents:
            self._intents[label] = self._practise(label)
        return self._intents[label]

    def _practise(self, label: PaperLabel) -> Intent:
        style = self.style
        planned = planned_strokes(self._robot)[label]
        start = hit_of(
            planned.hit_time_s, planned.hit_position, planned.hit_velocity, self._robot.limits.speed_rad_s
        )
        wish = self._wish(label, start)
        path = feed_path(self._feeder.nominal(label.side), self._scene)
        hit, _ = solve_hit(self._robot.model, start, wish, path, PATH_PERIOD_S, self._scene, _PRACTICE_STEPS)
        # From here on the own posture and rates are the familiar ones.
        wish = wish._replace(posture=angles_of(hit).copy(), rates=rates_of(hit).copy())
        swing_s = (planned.hit_time_s - planned.start_time_s) * style.swing
        ready = planned.start.position + style.ready_rad[label]
        return Intent(hit, wish, ready, swing_s, planned.follow_s)

    def _wish(self, label: PaperLabel, hit: Array) -> HitWish:
        style, planner = self.style, PlannerConfig()
        spin = planner.spin(label.stroke)
        spin += style.push_spin_rad_s if label.stroke is Stroke.PUSH else style.spin_fraction * spin
        offset_x, offset_y = style.landing_m[label]
        return HitWish(
            face=face_sign(label.side),
            spin_y=spin,
            landing_x=planner.landing_m[0] + offset_x,
            landing_y=-face_sign(label.side) * planner.landing_m[1] + offset_y,
            time=float(hit[TIME]) + style.hit_time_s[label],
            time_slack=_HIT_SLACK_S,
            highest_rate=0.85,
            posture=angles_of(hit).copy(),
            posture_weight=_POSTURE_WEIGHT,
            rates=rates_of(hit).copy(),
            rates_weight=_RATES_WEIGHT,
            lower=self._robot.planning.hit_lower_rad,
            upper=self._robot.planning.hit_upper_rad,
        )


def compile_ahead(teacher: Teacher, feeder: Feeder) -> None:
    """Let a teacher play against thin air, so that nothing has to be compiled while a ball is flying."""
    label = PaperLabel(Side.FOREHAND, Stroke.PUSH)
    stroke = teacher.begin(label, np.random.default_rng(0))
    path = feed_path(feeder.nominal(label.side), Scene().constants())
    for index in range(round(1.2 / PATH_PERIOD_S)):
        time_s = index * PATH_PERIOD_S
        stroke.see(time_s, path[index, :3])
        stroke.hand_at(time_s, stroke.ready_posture)
