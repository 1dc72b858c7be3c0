"""A teacher's strokes to some balls, and what it says to an arm that plays them otherwise."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, FIRST_ACTING_STEP, HORIZON
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyResults,
    RallyVariation,
)
from msrd_ros.table_tennis.teachers.rally_teacher import SOUND_COST, RallyTeacher

Array = NDArray[np.float64]

_AFTER_HIT_STEPS = 3
"""What a stroke is followed beyond its hit: until the ball is seen to fly away."""
_LOST_RAD = 0.25
"""An arm this far off the teacher's does not hit the ball any more."""


class Answers(NamedTuple):
    """States that an arm came through and what the teacher would have done.

    Shapes (K, T + 1, N + 6) and (K, T, N); `lengths` (K,) says how many steps are worth learning from: until
    the hit is over, which ends a stroke in a rally, or until the arm has strayed too far to hit the ball.
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    lengths: NDArray[np.int64]


class Lesson:
    """A teacher's strokes to K balls, and what it says to an arm that plays them otherwise.

    Parameters
    ----------
    teacher
        Of one strategy.
    incoming
        Balls when they set out, shape (K, 9), in the arm's frame.
    """

    def __init__(self, teacher: RallyTeacher, incoming: Array) -> None:
        self._teacher, self._incoming = teacher, incoming
        plans = [teacher.plan(ball) for ball in incoming]
        times_s = (FIRST_ACTING_STEP + np.arange(ACTING_STEPS + 1.0)) * CONTROL_PERIOD_S
        courses = [stroke.sample(times_s) for stroke, _ in plans]
        self._positions = np.stack([course.position for course in courses])
        speeds = np.stack([course.velocity for course in courses])[:, 1:]
        self._actions = speeds / teacher.robot.limits.speed_rad_s
        hits_s = np.array([stroke.hit_time_s for stroke, _ in plans])
        after = np.ceil(hits_s / CONTROL_PERIOD_S).astype(np.int64) - FIRST_ACTING_STEP + _AFTER_HIT_STEPS
        self._lengths = np.minimum(after, ACTING_STEPS)
        self.sound = np.array([cost < SOUND_COST for _, cost in plans])
        """Which balls the teacher can return as it wants to, shape (K,)."""

    def astray(self, step: int, joint_position: Array) -> Array:
        """How far joints at `joint_position` (K, N) are off the teacher's in a step, (K, N), rad."""
        return joint_position - self._positions[:, step]

    def answer(self, step: int, joint_position: Array, gain: float) -> Array:
        """The teacher's actions (K, N) where joints are at `joint_position` (K, N) in a step."""
        return np.clip(self._actions[:, step] - gain * self.astray(step, joint_position), -1.0, 1.0)

    def play(
        self,
        policy: Callable[[Array], Array] | None,
        teacher_share: float,
        noise: float,
        gain: float,
        ready_std_rad: float,
        rng: np.random.Generator,
    ) -> tuple[Answers, RallyResults]:
        """Play the balls in the batched simulator, and ask the teacher in every state.

        Parameters
        ----------
        policy
            What plays, from observations (K, N + 6) to actions (K, N); None leaves it to the teacher.
        teacher_share
            Of the teacher's answer in what is done.
        noise
            Standard deviation of what is added to the actions.
        gain
            Of the teacher's answer to a joint that has strayed, speed fractions a radian.
        ready_std_rad
            How far the arm's waiting joints stray.
        """
        robot, ready_pose = self._teacher.robot, self._teacher.ready_pose
        count = len(self._incoming)
        setup = KinematicRalliesConfig(variation=RallyVariation(ready_std_rad=0.0), threads=1, robot=robot)
        rallies = KinematicRallies([RallyPlan(self._teacher.label.side, ready_pose)], setup)
        ready = ready_pose + ready_std_rad * rng.standard_normal((1, count, robot.joint_count))
        seen = [rallies.start(self._incoming[None], ready, rng)[0]]
        answers, lengths = [], self._lengths.copy()
        for step in range(ACTING_STEPS):
            answer = self.answer(step, rallies.joint_position[0], gain)
            answers.append(answer)
            is_lost = np.abs(self.astray(step, rallies.joint_position[0])).max(axis=1) > _LOST_RAD
            lengths[is_lost] = np.minimum(lengths[is_lost], step)
            action = answer
            if policy is not None:
                action = teacher_share * answer + (1.0 - teacher_share) * policy(seen[-1])
            if noise:
                action = action + noise * rng.standard_normal(action.shape)
            seen.append(rallies.step(action[None])[0])
        rest = np.zeros((1, count, robot.joint_count))
        for _ in range(HORIZON - FIRST_ACTING_STEP - ACTING_STEPS):
            rallies.step(rest)
        observations = np.stack(seen, axis=1)[self.sound].astype(np.float32)
        actions = np.stack(answers, axis=1)[self.sound].astype(np.float32)
        return Answers(observations, actions, lengths[self.sound]), rallies.results()
