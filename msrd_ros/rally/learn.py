"""Learns the policies of rallies: strokes against balls that come back from the other arm.

Policies that have learned from the feeder's balls alone return hardly any that another arm has struck. So
they are played against their own balls: a generation of balls is struck in the batched simulator, and what
came back over the net is the next generation, as the other arm sees it. In each round a teacher says what it
would have done in every state that the policies came through, and they are cloned on these answers (DAgger:
Ross, Gordon and Bagnell, 2011), as all policies here are cloned: the teacher's answer to an arm that has
strayed from its stroke is the recovery label of `strokes.presets`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.learning.checkpoints import export_policies
from msrd_ros.learning.cloning import CloningConfig, clone
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.rally.lesson import Answers, Lesson
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import turned
from msrd_ros.table_tennis.ball.feeder import STANDARD, WIDE, Feeder
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.training import StrokeTrainingConfig, stroke_recipe
from msrd_ros.table_tennis.teachers.rally_teacher import RallyTeacher, RallyTeacherConfig

Array = NDArray[np.float64]

_LAST_ROUNDS = 3
FEWEST_RETURNS = 20
"""With fewer balls back over the net a generation has no next one."""


@dataclass(frozen=True)
class RallyLearningConfig:
    """Settings.

    Attributes
    ----------
    rounds
        Of playing, asking the teacher and cloning.
    balls
        In each generation, of each strategy.
    generations
        In each round, the first of which is fed.
    teacher_shares
        Of the teacher in what the arm does, in the first rounds; later the policies play alone.
    teacher_noise
        Of the actions in every other round in which the teacher plays alone, in speed fractions.
    kept_rounds
        From how many rounds the policies learn.
    hidden, steps, batch, learning_rates
        Of the networks and of the cloning in each round; rates while the teacher plays along, after that, and
        in the last three rounds, in which the policies settle.
    gain
        Of the teacher's answer to a joint that has strayed, speed fractions a radian.
    ready_std_rad
        How far the arm's waiting joints stray.
    jitter
        Added to the balls of a generation, shape (9,): standard deviations in m, m/s and rad/s.
    """

    rounds: int = 32
    balls: int = 120
    generations: int = 4
    teacher_shares: tuple[float, ...] = (1.0, 1.0, 0.6, 0.3)
    teacher_noise: float = 0.15
    kept_rounds: int = 8
    hidden: tuple[int, ...] = (64, 64)
    steps: int = 2000
    batch: int = 384
    learning_rates: tuple[float, float, float] = (3e-3, 1.5e-3, 4e-4)
    gain: float = 6.0
    ready_std_rad: float = 0.008
    jitter: tuple[float, ...] = (0.003, 0.0045, 0.003, 0.015, 0.012, 0.015, 0.45, 0.75, 0.45)


class RallyLearning:
    """Policies of both sides' pushes, for two such arms.

    Parameters
    ----------
    robot
        The arm.
    config
        Settings.
    seed
        Everything random follows from it.
    teacher
        What strokes are like.
    """

    def __init__(
        self,
        robot: Robot,
        config: RallyLearningConfig | None = None,
        seed: int = 0,
        teacher: RallyTeacherConfig | None = None,
    ) -> None:
        self.config = config or RallyLearningConfig()
        self._robot, self._seed = robot, seed
        self._rng = np.random.default_rng(seed)
        teaching = teacher or RallyTeacherConfig()
        self._teachers = {
            StrategyLabel(str(label)): RallyTeacher(label, robot, teaching)
            for label in (PaperLabel(side, Stroke.PUSH) for side in Side)
        }
        self._facts = {
            label: StrokeFacts(one.ready_pose, one.landing_m, one.label.side)
            for label, one in self._teachers.items()
        }
        self._answers: Mapping[StrategyLabel, deque[Answers]] = {
            label: deque(maxlen=self.config.kept_rounds * self.config.generations) for label in self._teachers
        }
        self._policies: GaussianPolicies | None = None
        self._layout = stroke_layout(robot, tuple(self._teachers))
        self.rounds_done = 0

    def run_round(self) -> dict[StrategyLabel, list[float]]:
        """Play, ask and clone; by strategy the share of returned balls in each generation."""
        shares = {label: self._play_generations(label) for label in self._teachers}
        self._clone()
        self.rounds_done += 1
        return shares

    def policies(self) -> StrokePolicies:
        """What has been learned so far.

        Raises
        ------
        ValueError
            If no round has been run.
        """
        if self._policies is None:
            raise ValueError("nothing is learned yet: run a round first")
        details = {"method": "rally", "seed": self._seed, "iterations": self.rounds_done}
        exported = export_policies(self._policies, self._layout, details)
        return StrokePolicies(exported, self._facts, robot=self._robot)

    def _play_generations(self, label: StrategyLabel) -> list[float]:
        config, teacher, number = self.config, self._teachers[label], self.rounds_done
        shares = config.teacher_shares
        teacher_share = shares[number] if number < len(shares) else 0.0
        policy = self._policy(label) if teacher_share < 1.0 else None
        noise = config.teacher_noise if policy is None and number % 2 else 0.0
        spread = WIDE if policy is None else STANDARD.wider(1.2)
        balls = Feeder().sample_states(teacher.label.side, spread, config.balls, self._rng)
        returned = []
        for _ in range(config.generations):
            lesson = Lesson(teacher, balls)
            answers, results = lesson.play(
                policy, teacher_share, noise, config.gain, config.ready_std_rad, self._rng
            )
            self._answers[label].append(answers)
            back = turned(results.struck_ball[0][results.returned[0]])
            returned.append(len(back) / len(balls))
            if len(back) < FEWEST_RETURNS:
                break
            jitter = np.array(config.jitter) * self._rng.standard_normal((config.balls, 9))
            balls = back[self._rng.integers(len(back), size=config.balls)] + jitter
        return returned

    def _policy(self, label: StrategyLabel) -> Callable[[Array], Array]:
        policy = self.policies().policies.policy(str(label))
        return lambda observations: np.asarray(policy.act(observations), dtype=np.float64)

    def _clone(self) -> None:
        """Go on cloning, on the answers of the last rounds."""
        config = self.config
        demonstrations = self._gather()
        if self._policies is None:
            self._policies = self._new_policies(demonstrations)
        left = config.rounds - self.rounds_done
        phase = 2 if left <= _LAST_ROUNDS else int(self.rounds_done >= len(config.teacher_shares))
        rate = config.learning_rates[phase]
        # The first networks know nothing at all.
        steps = config.steps * (2 if self.rounds_done == 0 else 1)
        clone(
            self._policies,
            DemonstrationPool(demonstrations),
            self._layout.observation_names,
            self._layout.action_names,
            CloningConfig(steps=steps, batch=config.batch, learning_rate=rate),
            torch.Generator().manual_seed(self._seed + self.rounds_done),
        )

    def _gather(self) -> Demonstrations:
        kept = [Answers(*map(np.concatenate, zip(*some, strict=True))) for some in self._answers.values()]
        most = max(len(one.observations) for one in kept)
        shape = len(kept), most
        observations = np.zeros((*shape, *kept[0].observations.shape[1:]), np.float32)
        actions = np.zeros((*shape, *kept[0].actions.shape[1:]), np.float32)
        lengths = np.zeros(shape, np.int64)
        for row, one in enumerate(kept):
            count = len(one.observations)
            observations[row, :count], actions[row, :count], lengths[row, :count] = one
        return Demonstrations(observations, actions, self._layout, lengths)

    def _new_policies(self, demonstrations: Demonstrations) -> GaussianPolicies:
        recipe = stroke_recipe(StrokeTrainingConfig(), tuple(self._teachers), self._robot)
        wanted = replace(recipe.policy, hidden=self.config.hidden)
        return GaussianPolicies(
            demonstrations.strategies,
            wanted.features.build(demonstrations),
            len(self._layout.action_names),
            wanted.hidden,
            float(np.log(wanted.std)),
            float(np.log(wanted.std_min)),
            float(np.log(wanted.std_max)),
            torch.Generator().manual_seed(self._seed),
        )
