"""Plays one learned strategy: ready pose, stroke, rest; the same code on topics and in process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, HORIZON, action_to_velocity, observe
from msrd_ros.contract.translation import BallTracker
from msrd_ros.robots.limits import JointReference, shape_command, velocity_towards
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.via_point_path import TRAVEL_SHARE, find_path, follow_path

PolicyFunction = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Maps an observation (N + 6,) to an action (N,)."""

READY_TOLERANCE_RAD = 1e-5
TRACKING_TOLERANCE_RAD = 0.25
"""A joint further than this from its command has met something."""
RALLY_TRAVEL_SHARE = 0.8
"""Of the speed limits, between two strokes of a rally, where the next ball is on its way."""
FOUND_AGAIN = 0.2
"""Share of it within which the arm is back at its command."""


class Phase(Enum):
    """What the arm is doing."""

    READYING = "moving to the ready pose"
    READY = "ready"
    STROKE = "playing"
    RESTING = "coming to rest"


class StrokePlayer:
    """Turns ticks of the control loop into commands.

    Between balls the reference moves to the ready pose and rests there. From the first sample that shows a
    fed ball the policy acts for `ACTING_STEPS` ticks; then the arm comes to rest until the episode is over.
    A ball that is fed before the arm is ready is let through. If the arm strays from its command, its stroke
    is over, and the reference comes back to where the arm is before it goes on. The reference never leaps:
    from each command to the next the limits hold, whatever is measured.

    Parameters
    ----------
    robot
        Whose arm, of N joints.
    joint_position
        Where the joints are now, shape (N,), rad.
    tracking_tolerance_rad
        A joint further than this from its command has strayed.
    in_rally
        Balls come back and again: a stroke is over as soon as its ball goes away, and a ball that set out
        before the arm was ready is played as well.
    """

    def __init__(
        self,
        robot: Robot,
        joint_position: NDArray[np.float64],
        tracking_tolerance_rad: float = TRACKING_TOLERANCE_RAD,
        in_rally: bool = False,
    ) -> None:
        self._robot = robot
        self._rest = np.zeros(robot.joint_count)
        self._measured = self._within_limits(joint_position)
        self.reference = JointReference(self._measured.copy(), self._rest.copy())
        self.phase = Phase.READYING
        self.strokes_begun = 0
        self._tracking_tolerance_rad = tracking_tolerance_rad
        self._in_rally = in_rally
        self._travel_share = RALLY_TRAVEL_SHARE if in_rally else TRAVEL_SHARE
        self._awaits_ball = False
        self._policy: PolicyFunction | None = None
        self._ready_pose: NDArray[np.float64] = self._measured.copy()
        self._began_at: tuple[NDArray[np.float64], ...] = ()
        self._path: Sequence[NDArray[np.float64]] | None = ()
        self._ball = BallTracker()
        self._step = 0
        self._astray = False

    @property
    def between_strokes(self) -> bool:
        """Whether a strategy or a policy may be exchanged now."""
        return self.phase in (Phase.READYING, Phase.READY)

    @property
    def step(self) -> int:
        """Ticks since the ball was fed."""
        return self._step

    def prepare(
        self,
        policy: PolicyFunction | None,
        ready_pose: NDArray[np.float64],
        began_at: NDArray[np.float64] | None = None,
    ) -> None:
        """Take the strategy to play next; only between strokes.

        Parameters
        ----------
        policy
            What to play; None lets balls through.
        ready_pose
            Where to wait for the ball, shape (N,), rad; what lies outside the joints' limits is drawn in.
        began_at
            Where the arm's last stroke began, shape (N,), rad, if someone else led it.
        """
        if began_at is not None:
            self._began_at = (began_at,)
        self._policy = policy
        self._ready_pose = np.clip(ready_pose, self._robot.limits.lowest_rad, self._robot.limits.highest_rad)
        self._set_out()

    def take(self, policy: PolicyFunction) -> None:
        """Play another policy from the same ready pose; only between strokes. No ball is missed for it."""
        self._policy = policy

    def begin_at(self, joint_position: NDArray[np.float64]) -> None:
        """Start anew from where the arm rests, shape (N,), rad, after a time in which nobody commanded it."""
        self._measured = self._within_limits(joint_position)
        self.go_on_from(JointReference(self._measured.copy(), self._rest.copy()))
        self._astray = False

    def go_on_from(self, reference: JointReference) -> None:
        """Take another state, (N,) in rad and rad/s, for the one commanded last; a stroke is over."""
        self.reference = reference
        self.forget_ball()
        if self.phase is not Phase.RESTING:
            self._set_out()

    def forget_ball(self) -> None:
        """Let a ball through that is in flight or comes without being seen; a stroke is over."""
        self._ball = BallTracker()
        # As if it had been fed before: a stroke begins with a ball that is seen before it flies.
        self._ball.fed = True
        self.phase = Phase.RESTING if self.phase is Phase.STROKE else self.phase

    def tick(
        self,
        joint_position: NDArray[np.float64],
        ball_position: NDArray[np.float64] | None,
        ball_stamp_ns: int = 0,
        period_s: float = CONTROL_PERIOD_S,
    ) -> JointReference:
        """Next command: joint positions and velocities one control period from now.

        Parameters
        ----------
        joint_position
            As measured, shape (N,), rad.
        ball_position
            Newest camera sample, shape (3,), m; None where it cannot be trusted.
        ball_stamp_ns
            When it was taken.
        period_s
            Control period.

        Raises
        ------
        UserError
            If the policy's output is not a number; the caller then holds still.
        """
        self.follow(joint_position)
        if ball_position is None:
            self.forget_ball()
        was_fed = self._ball.fed
        if ball_position is not None:
            self._ball.add(ball_position, ball_stamp_ns)
        self._awaits_ball = self._ball.fed and (not was_fed or (self._in_rally and self._awaits_ball))
        if self.phase is Phase.READY and self._awaits_ball and self._policy is not None:
            self.phase, self._step = Phase.STROKE, 0
            self._awaits_ball = False
            self.strokes_begun += 1
            self._began_at = (self._ready_pose,)
        elif self.phase is Phase.STROKE and self._in_rally and not self._ball.fed:
            self._set_out()
        if self.phase is Phase.STROKE:
            assert self._policy is not None
            action = self._policy(observe(joint_position, self._ball.position, self._ball.velocity))
            self.reference = shape_command(
                self._robot, self.reference, action_to_velocity(self._robot, action), period_s
            )
        elif self._astray:
            back = velocity_towards(self._robot, self.reference, self._measured, period_s)
            self.reference = shape_command(self._robot, self.reference, back, period_s)
        elif self.phase is Phase.RESTING:
            self.reference = shape_command(self._robot, self.reference, self._rest, period_s)
        else:
            self._move_to_ready(period_s)
        self._count()
        return self.reference

    def follow(self, joint_position: NDArray[np.float64]) -> float:
        """See where the arm is, shape (N,), rad; how far the worst joint is off its command.

        If that is too far, the reference comes back to the arm before anything else.
        """
        self._measured = self._within_limits(joint_position)
        error = float(np.abs(self._measured - self.reference.position).max())
        if error > self._tracking_tolerance_rad:
            self._astray = True
            if self.phase in (Phase.STROKE, Phase.RESTING):
                self.phase = Phase.RESTING
            else:
                self._set_out()
        elif error < FOUND_AGAIN * self._tracking_tolerance_rad:
            self._astray = False
        return error

    def hold(self, period_s: float = CONTROL_PERIOD_S) -> JointReference:
        """Decelerate to a stop and stay: for stale inputs, a disabled executor or an unusable policy."""
        self.forget_ball()
        self.reference = shape_command(self._robot, self.reference, self._rest, period_s)
        return self.reference

    def _within_limits(self, joint_position: NDArray[np.float64]) -> NDArray[np.float64]:
        """As measured, less what a joint at its stop is beyond it."""
        return np.clip(joint_position, self._robot.limits.lower_rad, self._robot.limits.upper_rad)

    def _set_out(self) -> None:
        """Make for the ready pose, on a path that is found when the arm moves: until then it may change."""
        self._path = None
        self.phase = Phase.READYING

    def _move_to_ready(self, period_s: float) -> None:
        if self._path is None:
            # The straight path from the end of a stroke may lead through the table.
            self._path = find_path(
                self._robot, self.reference, self._ready_pose, self._began_at, self._travel_share
            )
        under_way = bool(self._path)
        reference, self._path = follow_path(
            self._robot, self.reference, self._path, self._ready_pose, period_s, self._travel_share
        )
        close = np.abs(reference.position - self._ready_pose).max() < READY_TOLERANCE_RAD
        slow = np.abs(reference.velocity).max() * period_s < READY_TOLERANCE_RAD
        if close and slow and not under_way:
            # Land exactly, so that every stroke from this pose starts from the same numbers.
            reference = JointReference(self._ready_pose.copy(), self._rest.copy())
            self.phase, self._began_at = Phase.READY, ()
        self.reference = reference

    def _count(self) -> None:
        if self.phase not in (Phase.STROKE, Phase.RESTING):
            return
        self._step += 1
        if self._step >= HORIZON - 1:
            self._set_out()
        elif self._step >= ACTING_STEPS:
            self.phase = Phase.RESTING
