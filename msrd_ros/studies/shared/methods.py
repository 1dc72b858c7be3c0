"""The methods compared: each learns from the same demonstrations and gives the same two things.

A method's outcome is an `Estimate`. Those who learn by playing share networks, budget and number of
environment steps.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.airl import airl_per_strategy, pooled_airl
from msrd_ros.learning.baselines import StrategyClassifier, SupervisedRewards
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.rewards import RewardEnsemble, RewardForm
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.shared.estimates import (
    Estimate,
    from_classifier,
    from_places,
    from_rewards,
    from_teaching,
)
from msrd_ros.studies.shared.task import StrategyTruth, VirtualTask

N = TypeVar("N", StrategyClassifier, SupervisedRewards)


class Method(StrEnum):
    """Rows of the table: methods, and two yardsticks that know something of the truth."""

    MSRD = "msrd"
    MSRD_AS_PRINTED = "msrd_as_printed"
    VANILLA_DISTILLATION = "vanilla_distillation"
    AIRL = "airl"
    AIRL_EACH = "airl_each"
    AIRL_EACH_CROSS = "airl_each_cross"
    CLASSIFIER = "classifier"
    ORACLE = "oracle"
    SUPERVISED = "supervised"


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


def configure(task: VirtualTask, method: Method, budget: Budget) -> MSRDConfig:
    """The settings of a method that plays; AIRL's own changes are in `msrd_ros.learning.airl`."""
    printed = method in (Method.MSRD_AS_PRINTED, Method.AIRL_EACH)
    config = task.own_presets.get(method.value, task.preset)()
    config = replace(
        config,
        iterations=budget.iterations,
        episodes=budget.episodes,
        cloning=replace(config.cloning, steps=budget.cloning_steps),
    )
    if printed:
        return as_printed(config)
    if method is Method.VANILLA_DISTILLATION:
        return replace(config, reward=replace(config.reward, form=RewardForm.VANILLA))
    return config


def train(
    task: VirtualTask,
    method: Method,
    demonstrations: Demonstrations,
    budget: Budget,
    seed: int,
    progress: Callable[[str], None] = lambda line: None,
    truth: StrategyTruth | None = None,
) -> Estimate:
    """Run `method`; its rewards are the moving average of the weights after the last planned iteration.

    That is the rule for the checkpoint: fixed beforehand, and blind to the truth. Where the budget has
    several members, the rewards are the mean of that many runs on the same demonstrations.

    Parameters
    ----------
    truth
        True strategy rewards: for `Method.SUPERVISED`, which needs them; no method sees them.
    """
    started = time.perf_counter()
    if method is Method.CLASSIFIER:
        classifier = _fresh(StrategyClassifier, task, demonstrations, seed)
        classifier.fit(DemonstrationPool(demonstrations), budget.classifier_steps)
        return from_classifier(classifier, time.perf_counter() - started)
    if method is Method.SUPERVISED:
        if truth is None:
            raise ValueError("Method.SUPERVISED is supervised the true strategy rewards: pass truth")
        supervised = _fresh(SupervisedRewards, task, demonstrations, seed)
        supervised.fit(DemonstrationPool(demonstrations), truth.table, budget.classifier_steps)
        return from_teaching(supervised, time.perf_counter() - started)
    if method is Method.ORACLE:
        half = demonstrations.observations.shape[2] // 2
        settled = np.asarray(
            demonstrations.observations[:, :, half:, task.identifying_feature], dtype=np.float64
        )
        places = torch.as_tensor(settled.mean(axis=(1, 2)), dtype=torch.float32)
        return from_places(task, places, time.perf_counter() - started)
    members, steps = [], 0
    for member in range(budget.members):
        trainer = make_trainer(task, method, demonstrations, budget, seed + MEMBER_SEED * member)
        trainer.clone()
        for iteration in range(budget.iterations):
            metrics = trainer.iterate()
            if iteration % 10 == 9:
                right = 0.5 * (metrics["demonstrations_right"] + metrics["generated_right"])
                where = (
                    f"run {member + 1} of {budget.members}, iteration {iteration + 1} of {budget.iterations}"
                )
                progress(f"{method} seed {seed}: {where}, told apart {right:.2f}")
        members.append(trainer.averaged_rewards)
        steps += trainer.environment_steps
    return from_rewards(task, RewardEnsemble(members), time.perf_counter() - started, steps)


def make_trainer(
    task: VirtualTask, method: Method, demonstrations: Demonstrations, budget: Budget, seed: int
) -> MSRD:
    """The trainer of a method that plays."""
    makers = {
        Method.AIRL: pooled_airl,
        Method.AIRL_EACH: airl_per_strategy,
        Method.AIRL_EACH_CROSS: airl_per_strategy,
    }
    collector = task.make_collector(budget.horizon)
    autoreset = task.make_autoreset(budget.horizon) if task.make_autoreset else None
    config = configure(task, method, budget)
    return makers.get(method, MSRD)(config, demonstrations, collector, seed, autoreset=autoreset)


def restore(
    task: VirtualTask,
    tensors: dict[str, Tensor],
    method: Method,
    demonstrations: Demonstrations,
    budget: Budget,
) -> Estimate:
    """Inverse of `Estimate.tensors`."""
    seconds, steps = tensors["cost"].tolist()
    weights = {name: value for name, value in tensors.items() if name != "cost"}
    if method is Method.ORACLE:
        return from_places(task, weights["places"], seconds)
    if method is Method.CLASSIFIER:
        classifier = _fresh(StrategyClassifier, task, demonstrations, 0)
        classifier.network.load_state_dict(weights)
        return from_classifier(classifier, seconds)
    if method is Method.SUPERVISED:
        supervised = _fresh(SupervisedRewards, task, demonstrations, 0)
        supervised.bounds = weights.pop("bounds")
        supervised.network.load_state_dict(weights)
        return from_teaching(supervised, seconds)
    blank = make_trainer(task, method, demonstrations, budget, 0).averaged_rewards
    rewards = RewardEnsemble(copy.deepcopy(blank) for _ in range(budget.members))
    rewards.load_state_dict(weights)
    return from_rewards(task, rewards, seconds, int(steps))


def _fresh(network: type[N], task: VirtualTask, demonstrations: Demonstrations, seed: int) -> N:
    """A network on the demonstrations' states, untrained; no inverse reinforcement learning."""
    generator = torch.Generator().manual_seed(seed)
    return network(demonstrations.strategies, task.features, (32, 32), generator)
