"""One stroke as a teacher leads it: waits, watches the ball, plans, corrects, and leads the paddle through.

Everything is a function of what went in: samples of the ball, joint angles, and the flaws drawn beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.quintic import JointState, JointStroke, swing_effort
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.estimator import PATH_PERIOD_S, FlightEstimator
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.hit_solver import TIME, HitWish, angles_of, rates_of, solve_hit
from msrd_ros.table_tennis.teachers.impedance_guidance import leading_hand, shifted_posture
from msrd_ros.table_tennis.teachers.style import Flaws, Slip

Array = NDArray[np.float64]

_SWAY_FADE_S = 0.2
_SWING_FACTORS = (1.0, 1.2, 1.4, 1.6, 0.85)


@dataclass(frozen=True)
class AttentionConfig:
    """How a teacher reacts to the ball.

    Attributes
    ----------
    first_look_s
        From the first sight of the flying ball until it is judged for the first time.
    look_every_s
        Between one judgement and the next.
    commit_s
        So long before the hit the stroke is no longer changed.
    solver_steps
        Of the search for a hit, at each judgement.
    worst_cost
        A hit found that costs more than this is no good; the teacher sticks to the plan.
    comfortable
        Effort (see `swing_effort`) up to which a swing keeps its usual duration.
    hardest
        Effort beyond which a correction is not made.
    """

    first_look_s: float = 0.24
    look_every_s: float = 0.04
    commit_s: float = 0.12
    solver_steps: int = 3
    worst_cost: float = 40.0
    comfortable: float = 0.88
    hardest: float = 0.95


@dataclass(frozen=True)
class Intent:
    """What a teacher means to do.

    Attributes
    ----------
    hit
        The usual hit (1 + 2 N,), as of `hit_solver`; its time counts from the launch.
    wish
        What a hit has to achieve.
    ready
        Posture that the stroke starts from, shape (N,), rad.
    swing_s, follow_s
        Duration of the swing and of the follow-through.
    """

    hit: Array
    wish: HitWish
    ready: Array
    swing_s: float
    follow_s: float


class GuidedStroke:
    """The teacher's side of one stroke, from waiting in the ready pose to rest.

    Parameters
    ----------
    robot
        The arm that is led, of N joints.
    intent
        What the teacher means to do.
    flaws
        What is wrong with it this time.
    skill
        Share of the arm's resistance that the hand makes up for.
    scene
        `Scene.constants()`.
    grip
        The hand's grip.
    attention
        How the teacher reacts.
    """

    def __init__(
        self,
        robot: Robot,
        intent: Intent,
        flaws: Flaws,
        skill: float,
        scene: NDArray[np.void],
        grip: GuidanceConfig,
        attention: AttentionConfig,
    ) -> None:
        self._robot = robot
        self.intent, self.flaws = intent, flaws
        self.stroke: JointStroke | None = None
        self._skill, self._scene, self._grip, self._attention = skill, scene, grip, attention
        self._damping = np.array(robot.floating.joint_damping_nm_s)
        self._estimator = FlightEstimator(scene)
        self._hit = intent.hit
        self._rest = _at_rest(intent.ready)
        self._next_look_s = attention.first_look_s

    @property
    def ready_posture(self) -> Array:
        """Joint angles (N,) in rad that the stroke starts from."""
        return self.intent.ready

    def see(self, stamp_s: float, position: Array) -> None:
        """Take in the camera's newest sample of the ball; an old one again changes nothing."""
        self._estimator.see(stamp_s, position)

    def finished(self, time_s: float) -> bool:
        """Whether the follow-through has come to rest."""
        return self.stroke is not None and self._own_time(time_s) > self.stroke.end_time_s

    def hand_at(self, time_s: float, joint_position: Array) -> HandGesture:
        """Where the hand leads the paddle now: one streamed point.

        Parameters
        ----------
        time_s
            On the clock of the samples' stamps; must not go back.
        joint_position
            Where the arm is, shape (N,), rad. Before the ball flies the hand stays where it found it.
        """
        if self._estimator.first_seen_s is None:
            self._rest = _at_rest(np.array(joint_position))
            state = self._rest
            sway, sway_rate = np.zeros(6), np.zeros(6)
        else:
            self._decide(time_s)
            assert self.stroke is not None
            state = self.stroke.at(self._own_time(time_s))
            sway, sway_rate = self._sway(time_s)
        position, quaternion, twist = leading_hand(
            self._robot.model,
            state.position,
            state.velocity,
            state.acceleration,
            self._damping,
            self._grip.stiffness_n_m,
            self._grip.turn_stiffness_nm,
            self._skill,
            sway,
            sway_rate,
        )
        return HandGesture.now(position, quaternion, twist[:3], twist[3:])

    def _own_time(self, time_s: float) -> float:
        """The clock that the teacher moves by: seconds since the ball was first seen, and a bit late."""
        assert self._estimator.first_seen_s is not None
        return time_s - self._estimator.first_seen_s - self.flaws.delay_s

    def _sway(self, time_s: float) -> tuple[Array, Array]:
        """The hand's unsteadiness, which sets in with the swing and dies with the follow-through."""
        assert self.stroke is not None
        stroke, own = self.stroke, self._own_time(time_s)
        size, rate = self.flaws.tremor(own)
        fade = min((own - stroke.start_time_s) / _SWAY_FADE_S, (stroke.end_time_s - own) / _SWAY_FADE_S)
        fade = min(max(fade, 0.0), 1.0)
        smooth = fade * fade * (3.0 - 2.0 * fade)
        return smooth * size, smooth * rate

    def _decide(self, time_s: float) -> None:
        """Plan the stroke when the ball is first seen, and correct it as the flight is understood better."""
        own = self._own_time(time_s)
        if self.stroke is None:
            self.stroke = self._from_rest(self._hit)
        if own < self._next_look_s or own > self._hit[TIME] - self._attention.commit_s:
            return
        self._next_look_s += self._attention.look_every_s
        path = None if self.flaws.slip is Slip.INATTENTIVE else self._estimator.path()
        if path is None:
            return
        attention = self._attention
        hit, cost = solve_hit(
            self._robot.model,
            self._hit,
            self.intent.wish,
            path,
            PATH_PERIOD_S,
            self._scene,
            attention.solver_steps,
        )
        if cost > attention.worst_cost or hit[TIME] < own + attention.commit_s:
            return
        stroke = self._to_hit(own, hit)
        if swing_effort(stroke, self._robot) <= attention.hardest:
            self._hit, self.stroke = hit, stroke

    def _from_rest(self, hit: Array, own: float = 0.0) -> JointStroke:
        """A swing of the usual duration; a longer one where the way is too far for that."""
        hit_time = float(hit[TIME])
        goal = self._flawed(hit)
        swings = []
        for factor in _SWING_FACTORS:
            start = hit_time - factor * self.intent.swing_s
            if factor > 1.0 and start < own:
                break
            stroke = JointStroke(start, self._rest, hit_time, *goal, self.intent.follow_s)
            effort = swing_effort(stroke, self._robot)
            if effort <= self._attention.comfortable:
                return stroke
            swings.append((effort, factor, stroke))
        return min(swings)[2]

    def _to_hit(self, own: float, hit: Array) -> JointStroke:
        assert self.stroke is not None
        if own <= min(self.stroke.start_time_s, float(hit[TIME]) - self.intent.swing_s):
            return self._from_rest(hit, own)
        return self.stroke.continued_from(own, float(hit[TIME]), *self._flawed(hit))

    def _flawed(self, hit: Array) -> tuple[Array, Array]:
        """Joint angles and rates (N,) at the hit as the teacher will really lead to."""
        position = shifted_posture(self._robot.model, angles_of(hit), self.flaws.shift)
        return position, rates_of(hit) * self._robot.limits.speed_rad_s * self.flaws.speed


def _at_rest(position: Array) -> JointState:
    return JointState(position, np.zeros_like(position), np.zeros_like(position))
