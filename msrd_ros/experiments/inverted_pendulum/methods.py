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

from msrd_ros.experiments.inverted_pendulum.environment import InvertedPendulum
from msrd_ros.experiments.inverted_pendulum.truths import pendulum_features
from msrd_ros.learning.airl import airl_per_strategy, pooled_airl
from msrd_ros.learning.baselines import StrategyClassifier
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.presets import as_printed, inverted_pendulum
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.rewards import RewardForm, RewardModel
from msrd_ros.learning.rollouts import BatchedCollector
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
        Maps states ``[N, 4]`` to R0 ``[N]``; None if the method claims none.
    strategies
        Maps states ``[N, 4]`` to the strategy-only rewards ``[S, N]``; None if the method claims none.
    combined
        Maps states ``[N, 4]`` to R_i ``[S, N]`` (``[1, N]`` for a single reward); None if there is none.
    seconds, environment_steps
        What it took.
    """

    task: Rewards | None
    strategies: Rewards | None
    combined: Rewards | None
    seconds: float
    environment_steps: int


@dataclass(frozen=True)
class Budget:
    """What every method may use.

    Attributes
    ----------
    sweeps, episodes, horizon
        Sweeps, rollouts per strategy and sweep, steps per rollout.
    cloning_steps
        Adam steps of behaviour cloning before.
    """

    sweeps: int = 250
    episodes: int = 4
    horizon: int = 250
    cloning_steps: int = 1500


def configure(method: Method, budget: Budget) -> MSRDConfig:
    """The settings of a method that plays; AIRL's own changes are in `msrd_ros.learning.airl`."""
    config = inverted_pendulum()
    config = replace(
        config,
        sweeps=budget.sweeps,
        episodes=budget.episodes,
        cloning=replace(config.cloning, steps=budget.cloning_steps),
    )
    if method in (Method.MSRD_AS_PRINTED, Method.AIRL_EACH):
        return as_printed(config)
    if method is Method.VANILLA_DISTILLATION:
        return replace(config, reward=replace(config.reward, form=RewardForm.VANILLA))
    return config


def train(
    method: Method,
    demonstrations: Demonstrations,
    budget: Budget,
    seed: int,
    progress: Callable[[str], None] = lambda line: None,
    config: MSRDConfig | None = None,
) -> Estimate:
    """Run `method`; its rewards are the moving average of the weights after the last planned sweep."""
    started = time.perf_counter()
    if method is Method.CLASSIFIER:
        return _classify(demonstrations, seed)
    if method is Method.ORACLE:
        return _oracle(demonstrations)
    collector = BatchedCollector(InvertedPendulum(budget.horizon))
    make = {
        Method.AIRL: pooled_airl,
        Method.AIRL_EACH: airl_per_strategy,
        Method.AIRL_EACH_CROSS: airl_per_strategy,
    }.get(method, MSRD)
    trainer = make(config or configure(method, budget), demonstrations, collector, seed)
    trainer.clone()
    for sweep in range(budget.sweeps):
        metrics = trainer.sweep()
        if sweep % 10 == 9:
            right = 0.5 * (metrics["demonstrations_right"] + metrics["generated_right"])
            progress(f"{method} seed {seed}: sweep {sweep + 1} of {budget.sweeps}, told apart {right:.2f}")
    seconds = time.perf_counter() - started
    return estimate_from_rewards(trainer.averaged_rewards, method, seconds, trainer.environment_steps)


def estimate_from_rewards(
    rewards: RewardModel, method: Method, seconds: float, environment_steps: int
) -> Estimate:
    """The functions of states that a trained reward model stands for.

    AIRL per strategy has no task reward of its own; the mean of its rewards is the natural guess at one, and
    its rewards as they are stand for the strategies', as in the paper.
    """

    @torch.no_grad()
    def values(states: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        packed = torch.zeros(1, states.shape[0], 2 * states.shape[1] + 3)
        packed[0, :, states.shape[1] + 1 : 2 * states.shape[1] + 1] = states
        found = rewards.table(Transitions(packed, states.shape[1], 1))
        return found.combined, found.task, found.strategy

    def task(states: Tensor) -> Tensor:
        combined, own, _ = values(states)
        per_strategy = method in (Method.AIRL_EACH, Method.AIRL_EACH_CROSS)
        return combined.mean(dim=0) if per_strategy else own[0]

    strategies = None if method is Method.AIRL else lambda states: values(states)[2]
    return Estimate(task, strategies, lambda states: values(states)[0], seconds, environment_steps)


def _classify(demonstrations: Demonstrations, seed: int) -> Estimate:
    """No inverse reinforcement learning: log q(i|s) of a softmax classifier on the demonstrations."""
    started = time.perf_counter()
    generator = torch.Generator().manual_seed(seed)
    classifier = StrategyClassifier(demonstrations.strategies, pendulum_features(), (32, 32), generator)
    classifier.fit(DemonstrationPool(demonstrations))
    return Estimate(None, classifier.log_posterior, None, time.perf_counter() - started, 0)


def _oracle(demonstrations: Demonstrations) -> Estimate:
    """A guess that knows the answer's form: distance to the cart position where the strategy settles."""
    started = time.perf_counter()
    half = demonstrations.observations.shape[2] // 2
    settled = np.asarray(demonstrations.observations[:, :, half:, 0], dtype=np.float64)
    places = torch.as_tensor(settled.mean(axis=(1, 2)), dtype=torch.float32)

    def strategies(states: Tensor) -> Tensor:
        return -(states[None, :, 0] - places[:, None]).abs()

    return Estimate(None, strategies, None, time.perf_counter() - started, 0)
