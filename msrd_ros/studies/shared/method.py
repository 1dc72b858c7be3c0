"""What a method compared in a study is: something that turns demonstrations into an `Estimate`."""

from __future__ import annotations

import copy
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

from torch import Tensor

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.harness import Harness, Task
from msrd_ros.learning.method import Learner, Method, Problem
from msrd_ros.learning.rewards import RewardEnsemble
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.shared.estimates import Estimate, from_rewards
from msrd_ros.studies.shared.task import LearningTask, StrategyTruth

MEMBER_SEED = 100
"""Distance between the seeds of the runs that are averaged: repetitions are counted below it."""


@dataclass(frozen=True)
class Budget:
    """What every method may use.

    Attributes
    ----------
    iterations, episodes, horizon
        Iterations, rollouts per strategy and iteration, steps per rollout.
    cloning_steps
        Adam steps of behaviour cloning before.
    classifier_steps
        Adam steps of the softmax classifier, and of the regression on the truth.
    members
        Independent runs whose rewards are averaged.
    """

    iterations: int = 60
    episodes: int = 1
    horizon: int = 1000
    cloning_steps: int = 800
    classifier_steps: int = 2500
    members: int = 1


@dataclass(frozen=True)
class Exercise:
    """Everything that a method is given.

    Attributes
    ----------
    task, demonstrations, budget
        The same for every method.
    seed
        Everything random follows from it.
    truth
        True strategy rewards: for the regression on them; no method sees them.
    """

    task: LearningTask
    demonstrations: Demonstrations
    budget: Budget
    seed: int = 0
    truth: StrategyTruth | None = None


class StudyMethod(ABC):
    """A row of the table.

    Attributes
    ----------
    name, title
        As in names of files, and as tables and figures call it.
    """

    name: str
    title: str

    def settings(self, task: LearningTask, budget: Budget) -> Any:
        """Everything that a run depends on beside the exercise, as data for JSON."""
        return [self.name, budget.classifier_steps]

    @abstractmethod
    def train(self, exercise: Exercise) -> Estimate:
        """Learn."""

    @abstractmethod
    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """The estimate that had these weights and took so many seconds and environment steps."""


def restore(method: StudyMethod, exercise: Exercise, tensors: dict[str, Tensor]) -> Estimate:
    """Inverse of `Estimate.tensors`."""
    seconds, steps = tensors["cost"].tolist()
    weights = {name: value for name, value in tensors.items() if name != "cost"}
    return method.restore(exercise, weights, seconds, int(steps))


class InverseLearning(StudyMethod):
    """A method that learns by playing; all of these share networks, budget and number of steps.

    Its rewards are the moving average of the weights after the last planned iteration. That is the rule for
    the checkpoint: fixed beforehand, and blind to the truth. Where the budget has several members, the
    rewards are the mean of that many runs on the same demonstrations.

    Parameters
    ----------
    method
        What learns.
    """

    def __init__(self, method: Method) -> None:
        self.name, self.title = method.name, method.title
        self._method = method

    def recipe(self, task: LearningTask, budget: Budget) -> MSRDConfig:
        """The task's settings within the budget, before the method makes its own changes."""
        config = task.own_presets.get(self.name, task.preset)()
        return replace(
            config,
            iterations=budget.iterations,
            episodes=budget.episodes,
            cloning=replace(config.cloning, steps=budget.cloning_steps),
        )

    def settings(self, task: LearningTask, budget: Budget) -> Any:
        """Recipe, steps of a rollout, and runs."""
        return [self.name, self.recipe(task, budget).to_dict(), budget.horizon, budget.members]

    def start(self, exercise: Exercise, member: int = 0) -> Learner:
        """One run, before its first step."""
        task, budget = exercise.task, exercise.budget
        return self._method.start(
            Problem(
                self.recipe(task, budget),
                exercise.demonstrations,
                task.make_collector(budget.horizon),
                exercise.seed + MEMBER_SEED * member,
                autoreset=task.make_autoreset(budget.horizon) if task.make_autoreset else None,
            )
        )

    def train(self, exercise: Exercise) -> Estimate:
        """Run all members."""
        started, members, steps = time.perf_counter(), [], 0
        for member in range(exercise.budget.members):
            learner = self.start(exercise, member)
            Harness(learner, Task()).run()
            members.append(learner.averaged_rewards)
            steps += learner.environment_steps
        return from_rewards(exercise.task, RewardEnsemble(members), time.perf_counter() - started, steps)

    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """Rewards of that shape, with the weights."""
        blank = self.start(exercise).averaged_rewards
        rewards = RewardEnsemble(copy.deepcopy(blank) for _ in range(exercise.budget.members))
        rewards.load_state_dict(weights)
        return from_rewards(exercise.task, rewards, seconds, steps)
