"""Rows of the table: the methods, whose policies are kept as well, and yardsticks that learn nothing."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.learning import methods as learning
from msrd_ros.learning.examples.lunar_lander import OBSERVATION_NAMES
from msrd_ros.learning.harness import Harness, Task
from msrd_ros.learning.method import Method
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rewards import RewardEnsemble
from msrd_ros.studies.lunar_lander.environment import shaping_potential
from msrd_ros.studies.shared.estimates import Estimate, Rewards, from_rewards
from msrd_ros.studies.shared.method import Exercise, InverseLearning, StudyMethod
from msrd_ros.studies.shared.yardsticks import Classifier

Demonstrated: TypeAlias = NDArray[np.floating]

CLONED, LEARNED = "policies/cloned", "policies/learned"


@dataclass(frozen=True, kw_only=True)
class PlayedEstimate(Estimate):
    """An estimate with the policies that go with it.

    Attributes
    ----------
    cloned, learned
        As cloning left them, and after the last iteration.
    """

    cloned: Policies
    learned: Policies


class PlayedMethod(InverseLearning):
    """A method that learns by playing, in one run, whose policies are judged as well."""

    def train(self, exercise: Exercise) -> PlayedEstimate:
        """Run it."""
        started = time.perf_counter()
        learner = self.start(exercise)
        watch = _Watch()
        Harness(learner, watch).run()
        assert watch.cloned is not None
        rewards = RewardEnsemble([learner.averaged_rewards])
        seconds = time.perf_counter() - started
        found = from_rewards(exercise.task, rewards, seconds, learner.environment_steps)
        return _played(found, watch.cloned, learner.policies)

    def restore(
        self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int
    ) -> PlayedEstimate:
        """Rewards and policies of that shape, with the weights."""
        learner = self.start(exercise)
        cloned, learned = copy.deepcopy(learner.policies), learner.policies
        cloned.set_flat(weights.pop(CLONED))
        learned.set_flat(weights.pop(LEARNED))
        rewards = RewardEnsemble([learner.averaged_rewards])
        rewards.load_state_dict(weights)
        return _played(from_rewards(exercise.task, rewards, seconds, steps), cloned, learned)


def _played(estimate: Estimate, cloned: Policies, learned: Policies) -> PlayedEstimate:
    weights = {**estimate.weights, CLONED: cloned.flat(), LEARNED: learned.flat()}
    return PlayedEstimate(**vars(replace(estimate, weights=weights)), cloned=cloned, learned=learned)


class _Watch(Task):
    """Keeps the policies as cloning left them."""

    cloned: Policies | None = None

    def at_point(self, harness: Harness) -> None:
        """Before the first iteration."""
        if self.cloned is None:
            self.cloned = copy.deepcopy(harness.learner.policies)


class Yardstick(StudyMethod):
    """A task reward that is written down, or follows from the demonstrated states without any learning.

    Parameters
    ----------
    name, title
        As of `StudyMethod`.
    make
        Gives the reward for the demonstrated states ``[N, 8]``.
    """

    def __init__(self, name: str, title: str, make: Callable[[Demonstrated], Rewards]) -> None:
        self.name, self.title = name, title
        self._make = make

    def train(self, exercise: Exercise) -> Estimate:
        """Look at the demonstrations."""
        started = time.perf_counter()
        observations = exercise.demonstrations.observations
        reward = self._make(observations.reshape(-1, observations.shape[-1]))
        return Estimate(reward, None, None, {}, time.perf_counter() - started, 0)

    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """The same again."""
        return replace(self.train(exercise), seconds=seconds)


def nearness(demonstrated: Demonstrated) -> Rewards:
    """Minus the Mahalanobis distance to all demonstrated states."""
    centre = demonstrated.mean(axis=0)
    precision = torch.as_tensor(np.linalg.pinv(np.cov(demonstrated, rowvar=False)), dtype=torch.float32)
    middle = torch.as_tensor(centre, dtype=torch.float32)

    def reward(states: Tensor) -> Tensor:
        away = states - middle
        return -((away @ precision) * away).sum(dim=-1).clamp(min=0.0).sqrt()

    return reward


def slowness(demonstrated: Demonstrated) -> Rewards:
    """Minus the speed."""
    columns = [OBSERVATION_NAMES.index(name) for name in ("vx", "vy")]
    return lambda states: -states[..., columns].norm(dim=-1)


def potential(demonstrated: Demonstrated) -> Rewards:
    """Gymnasium's shaping potential."""
    return lambda states: torch.as_tensor(shaping_potential(states.numpy()), dtype=torch.float32)


def _playing() -> dict[str, Method]:
    return {name: method for name, method in learning.METHODS.items() if method.has_rewards}


YARDSTICKS = (
    Yardstick("nearness", "minus the Mahalanobis distance to the demonstrations", nearness),
    Yardstick("slowness", "minus the speed", slowness),
    Yardstick("potential", "Gymnasium's shaping potential", potential),
)
METHODS: dict[str, StudyMethod] = {
    **{name: PlayedMethod(method) for name, method in _playing().items()},
    Classifier.name: Classifier(),
    **{yardstick.name: yardstick for yardstick in YARDSTICKS},
}
"""Rows of the table, by name."""
