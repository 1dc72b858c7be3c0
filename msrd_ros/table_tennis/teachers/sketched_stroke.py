"""A sketched stroke as it is led: the same motion, fitted to the ball that really comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.quintic import JointStroke
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import return_flight
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.guided_stroke import AttentionConfig, GuidedStroke, Intent
from msrd_ros.table_tennis.teachers.hit_solver import TIME, HitWish, solve_hit
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, feed_path
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan, lead_to
from msrd_ros.table_tennis.teachers.style import Flaws, Slip

Array = NDArray[np.float64]

_HIT_SLACK_S = 0.03
_FAITHFUL = 3.0
"""Residual per rad and per share of the speed limits by which a hit leaves the sketched one."""
_HIGHEST_RATE = 0.85


class SketchedStroke(GuidedStroke):
    """One stroke led as it was sketched.

    The contact is shifted in place and time, as far as the arm reaches, such that the hit does to the ball
    that comes what the sketched one does to the expected ball: same spin, same landing, near the same angles.
    The follow-through is shifted along. A sketch that does not hit the expected ball is led as it is.

    Parameters
    ----------
    robot
        The arm that is led, of N joints.
    plan
        Of `plan_sketch`, for this arm.
    scene, grip, attention
        Table and ball, the hand's grip as the simulator has it, and how the hand reacts to the ball; the
        standard ones if None.

    Raises
    ------
    UserError
        If the plan has violations.
    """

    def __init__(
        self,
        robot: Robot,
        plan: SketchPlan,
        scene: Scene | None = None,
        grip: GuidanceConfig | None = None,
        attention: AttentionConfig | None = None,
    ) -> None:
        plan.require_possible()
        constants, attention = (scene or Scene()).constants(), attention or AttentionConfig()
        planned, flaws = plan.stroke, Flaws.none()
        rates = planned.hit_velocity / robot.limits.speed_rad_s
        hit = np.concatenate([[planned.hit_time_s], planned.hit_position, rates])
        wish = _same_again(robot, plan, hit, constants)
        if plan.prediction.outcome.struck:
            # Whatever the person's own hit costs, by the solver's taste, is no reason to give up.
            path = feed_path(plan.sketch.feed, constants)
            _, cost = solve_hit(robot.model, hit, wish, path, PATH_PERIOD_S, constants, 0)
            attention = replace(attention, worst_cost=attention.worst_cost + cost)
        else:
            flaws = replace(flaws, slip=Slip.INATTENTIVE)
        swing_s = planned.hit_time_s - planned.start_time_s
        intent = Intent(hit, wish, plan.states.position[0], swing_s, planned.follow_s)
        super().__init__(robot, intent, flaws, 1.0, constants, grip or GuidanceConfig(), attention)
        self.plan = plan

    def _from_rest(self, hit: Array, own: float = 0.0) -> JointStroke:
        """The sketched motion to a hit, from where the arm waits."""
        planned, start_s = self.plan.stroke, float(hit[TIME]) - self.intent.swing_s
        start, lead_in = self._rest, None
        if planned.lead_in is not None:
            start = planned.start
            lead_in = lead_to(self._robot, self._rest.position, start.position, start_s)
        stroke = replace(planned, start_time_s=start_s, start=start, lead_in=lead_in)
        return self._through(stroke, hit)

    def _to_hit(self, own: float, hit: Array) -> JointStroke:
        """As `_from_rest` while nothing has moved; from where the motion is afterwards."""
        assert self.stroke is not None
        fresh = self._from_rest(hit)
        if own <= min(self.stroke.first_time_s, fresh.first_time_s):
            return fresh
        position, velocity = self._flawed(hit)
        return self._through(self.stroke.continued_from(own, float(hit[TIME]), position, velocity), hit)

    def _through(self, stroke: JointStroke, hit: Array) -> JointStroke:
        """The stroke through a hit, with a follow-through that is shifted along with it."""
        position, velocity = self._flawed(hit)
        planned, limits = self.plan.stroke, self._robot.limits
        assert planned.end_position is not None
        end = planned.end_position + position - planned.hit_position
        return replace(
            stroke,
            hit_time_s=float(hit[TIME]),
            hit_position=position,
            hit_velocity=velocity,
            end_position=np.clip(end, limits.lowest_rad, limits.highest_rad),
        )


def _same_again(robot: Robot, plan: SketchPlan, hit: Array, scene: NDArray[np.void]) -> HitWish:
    """The wish that the sketched hit fulfils."""
    flight = return_flight(plan.hit.ball_out, scene)
    rates = hit[1 + robot.joint_count :]
    return HitWish(
        face=plan.face,
        spin_y=float(plan.hit.ball_out[7]),
        landing_x=flight.landing_x,
        landing_y=flight.landing_y,
        time=plan.stroke.hit_time_s,
        time_slack=_HIT_SLACK_S,
        highest_rate=max(_HIGHEST_RATE, float(np.abs(rates).max())),
        posture=plan.stroke.hit_position,
        posture_weight=_FAITHFUL,
        rates=rates.copy(),
        rates_weight=_FAITHFUL,
        lower=robot.limits.lowest_rad,
        upper=robot.limits.highest_rad,
    )
