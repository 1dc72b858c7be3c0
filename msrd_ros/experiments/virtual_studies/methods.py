"""The methods compared: each learns from the same demonstrations and gives the same two things.

A method's outcome is an `Estimate`: a task reward (or none) and a strategy reward per strategy (or none), as
functions of states. Those who learn by playing share networks, budget and number of environment steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import torch
from torch import Tensor

from msrd_ros.experiments.virtual_studies.task import VirtualTask
from msrd_ros.learning.airl import airl_per_strategy, pooled_airl
from msrd_ros.learning.baselines import StrategyClassifier
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.rewards import RewardForm, RewardModel, RewardValues
from msrd_ros.learning.trajectories import Demonstrations, Transitions


class Method(StrEnum):
    """Rows of the table."""

    MSRD = "msrd"
    MSRD_AS_PRINTED = "msrd_as_printed"
    VANILLA_DISTILLATION = "vanilla_distillation"
    AIRL = "airl"
    AIRL_EACH = "airl_each"
    AIRL_EACH_CROSS = "airl_each_cross"
    CLASSIFIER = "classifier"
    ORACLE = "oracle"


Rewards = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class Estimate:
    """What a method inferred.

    Attributes
    ----------
    task
        Maps states ``[N, O]`` to R0 ``[N]``; None if the method claims none.
    strategies
        Maps states ``[N, O]`` to the strategy-only rewards ``[S, N]``; None if the method claims none.
    combined
        Maps states ``[N, O]`` to R_i ``[S, N]`` (``[1, N]`` for a single reward); None if there is none.
    weights
        The numbers behind the functions, to keep.
    seconds, environment_steps
        What it took.
    """

    task: Rewards | None
    strategies: Rewards | None
    combined: Rewards | None
    weights: dict[str, Tensor]
    seconds: float
    environment_steps: int

    def tensors(self) -> dict[str, Tensor]:
        """Weights and cost, for a file."""
        cost = torch.tensor([self.seconds, float(self.environment_steps)], dtype=torch.float64)
        return {"cost": cost, **{name: value.contiguous() for name, value in self.weights.items()}}


@dataclass(frozen=True)
class Budget:
    """What every method may use.

    Attributes
    ----------
    sweeps, episodes, horizon
        Sweeps, rollouts per strategy and sweep, steps per rollout.
    cloning_steps
        Adam steps of behaviour cloning before.
    classifier_steps
        Adam steps of the softmax classifier.
    """

    sweeps: int = 60
    episodes: int = 1
    horizon: int = 1000
    cloning_steps: int = 800
    classifier_steps: int = 2500


def configure(task: VirtualTask, method: Method, budget: Budget) -> MSRDConfig:
    """The settings of a method that plays; AIRL's own changes are in `msrd_ros.learning.airl`."""
    printed = method in (Method.MSRD_AS_PRINTED, Method.AIRL_EACH)
    config = (task.printed_preset if printed and task.printed_preset else task.preset)()
    config = replace(
        config,
        sweeps=budget.sweeps,
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
) -> Estimate:
    """Run `method`; its rewards are the moving average of the weights after the last planned sweep.

    That is the rule for the checkpoint: fixed beforehand, and blind to the truth.
    """
    started = time.perf_counter()
    if method is Method.CLASSIFIER:
        classifier = _fresh_classifier(task, demonstrations, seed)
        classifier.fit(DemonstrationPool(demonstrations), budget.classifier_steps)
        return _from_classifier(classifier, time.perf_counter() - started)
    if method is Method.ORACLE:
        half = demonstrations.observations.shape[2] // 2
        settled = np.asarray(demonstrations.observations[:, :, half:, task.telling_column], dtype=np.float64)
        places = torch.as_tensor(settled.mean(axis=(1, 2)), dtype=torch.float32)
        return _from_places(task, places, time.perf_counter() - started)
    trainer = make_trainer(task, method, demonstrations, budget, seed)
    trainer.clone()
    for sweep in range(budget.sweeps):
        metrics = trainer.sweep()
        if sweep % 10 == 9:
            right = 0.5 * (metrics["demonstrations_right"] + metrics["generated_right"])
            progress(f"{method} seed {seed}: sweep {sweep + 1} of {budget.sweeps}, told apart {right:.2f}")
    cost = time.perf_counter() - started, trainer.environment_steps
    return from_rewards(task, trainer.averaged_rewards, method, *cost)


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
    return makers.get(method, MSRD)(configure(task, method, budget), demonstrations, collector, seed)


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
        return _from_places(task, weights["places"], seconds)
    if method is Method.CLASSIFIER:
        classifier = _fresh_classifier(task, demonstrations, 0)
        classifier.network.load_state_dict(weights)
        return _from_classifier(classifier, seconds)
    rewards = make_trainer(task, method, demonstrations, budget, 0).averaged_rewards
    rewards.load_state_dict(weights)
    return from_rewards(task, rewards, method, seconds, int(steps))


def from_rewards(
    task: VirtualTask, rewards: RewardModel, method: Method, seconds: float, environment_steps: int
) -> Estimate:
    """The functions of states that a trained reward model stands for.

    AIRL per strategy has no task reward of its own; the mean of its rewards is the natural guess at one, and
    its rewards as they are stand for the strategies', as in the paper.
    """

    @torch.no_grad()
    def values(states: Tensor) -> RewardValues:
        width, actions = task.observation_width, task.action_width
        packed = torch.zeros(1, states.shape[0], 2 * width + actions + 2)
        packed[0, :, width + actions : 2 * width + actions] = states
        return rewards.table(Transitions(packed, width, actions))

    @torch.no_grad()
    def task_reward(states: Tensor) -> Tensor:
        if method in (Method.AIRL_EACH, Method.AIRL_EACH_CROSS):
            return values(states).combined.mean(dim=0)
        return rewards.task_network(rewards.task_features(states.unsqueeze(0)))[0, :, 0]

    return Estimate(
        task_reward,
        None if method is Method.AIRL else lambda states: values(states).strategy,
        lambda states: values(states).combined,
        dict(rewards.state_dict()),
        seconds,
        environment_steps,
    )


def _fresh_classifier(task: VirtualTask, demonstrations: Demonstrations, seed: int) -> StrategyClassifier:
    """No inverse reinforcement learning: a softmax classifier on the demonstrations' states."""
    generator = torch.Generator().manual_seed(seed)
    return StrategyClassifier(demonstrations.strategies, task.features, (32, 32), generator)


def _from_classifier(classifier: StrategyClassifier, seconds: float) -> Estimate:
    """log q(i|s) as the strategy reward."""
    weights = dict(classifier.network.state_dict())
    return Estimate(None, classifier.log_posterior, None, weights, seconds, 0)


def _from_places(task: VirtualTask, places: Tensor, seconds: float) -> Estimate:
    """A guess that knows the answer's form: minus the distance to where the strategy's column settles."""

    def strategies(states: Tensor) -> Tensor:
        return -(states[None, :, task.telling_column] - places[:, None]).abs()

    return Estimate(None, strategies, None, {"places": places}, seconds, 0)
