"""The methods compared: each learns from the same recordings, and each can be played.

What they share is the recipe of `stroke_training`: networks, cloning, simulator, rollouts, trust region and
iterations; every method changes only what its name says.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policy_improvement import PolicyImprovement
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.rewards import RewardForm, RewardModel
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.studies.table_tennis.recording import Progress, StudyData
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import StrokeTraining, StrokeTrainingConfig


class Method(StrEnum):
    """Rows of the table."""

    MSRD = "msrd"
    BEHAVIOUR_CLONING = "behaviour_cloning"
    CLONING_WITH_NOISE = "cloning_with_noise"
    OPEN_LOOP = "open_loop"
    AIRL = "airl"
    AIRL_EACH = "airl_each"
    FROZEN_REWARD = "frozen_reward"
    MSRD_RANDOMISED = "msrd_randomised"
    MSRD_CORRECTIVE_START = "msrd_corrective_start"
    MSRD_AS_PRINTED = "msrd_as_printed"
    AIRL_EACH_CROSS = "airl_each_cross"
    MSRD_PER_STROKE = "msrd_per_stroke"


MAIN_METHODS = (
    Method.MSRD,
    Method.BEHAVIOUR_CLONING,
    Method.CLONING_WITH_NOISE,
    Method.OPEN_LOOP,
    Method.AIRL,
    Method.AIRL_EACH,
    Method.FROZEN_REWARD,
)
"""In every table; the others say what single parts of the recipe do."""

UNPLAYED = (Method.BEHAVIOUR_CLONING, Method.CLONING_WITH_NOISE)
CORRECTIVE_START = (Method.CLONING_WITH_NOISE, Method.MSRD_CORRECTIVE_START)
"""Cloned with injected joint offsets; everyone else starts from plain cloning."""

PRIOR_WEIGHT = 1.0
"""What leaving the cloned policy costs under frozen rewards, per nat. Without it a stroke that had reached
97 % fell to 44 in 60 iterations, at .2 to 82 in 45: a reward that no discriminator corrects any more is
followed to where it was never told anything. Chosen on another population, as is the next."""

REFIT_STEPS = 600
"""Adam steps of `MSRD.refit_on_replay` before they are frozen. With them, and without any price on leaving
the clone, the same stroke was still at 88 % after 60 iterations."""

RANDOMISED: dict[str, Any] = {"spread": "wide", "camera_noise_m": 0.003, "camera_latency_s": 0.02}
"""Training conditions of `Method.MSRD_RANDOMISED`."""


@dataclass(frozen=True)
class Budget:
    """What every method may use.

    Attributes
    ----------
    iterations, episodes
        Iterations over all strategies, and rollouts per strategy in each.
    plain_cloning_steps
        Adam steps of plain cloning. Cloning is a rival here, so it gets what is best for it: with 24
        demonstrations a label 2000 steps returned 86 % in evaluations, the recipe's 500 steps 76 %.
    cloning_steps
        Of all cloning, if given.
    evaluate_every, evaluation_balls
        Iterations between points of the curve, and balls per strategy for each point.
    threads
        Of the batched simulator.
    """

    iterations: int = 80
    episodes: int = 200
    plain_cloning_steps: int = 2000
    cloning_steps: int | None = None
    evaluate_every: int = 10
    evaluation_balls: int = 200
    threads: int = 2


@dataclass(frozen=True)
class Learned:
    """What a method made of the recordings.

    Attributes
    ----------
    policies
        Ready to play.
    rewards
        Weights of the averaged reward networks; empty if it has none.
    lasting
        Those of MSRD's rewards refitted on replay, to be frozen; empty for all others.
    report
        ``curve`` (struck and returned shares in the batched simulator), ``seconds``, ``cpu_seconds``,
        ``env_steps``.
    """

    policies: StrokePolicies
    rewards: dict[str, Tensor]
    lasting: dict[str, Tensor]
    report: dict[str, Any]


def pooled_reward(config: MSRDConfig) -> MSRDConfig:
    """AIRL on all demonstrations: one reward of ball and joints for all six strokes.

    One policy for all would have to be told which stroke is asked for; it is told by being six networks,
    one for each label, all trained on the same reward.
    """
    reward = replace(
        config.reward,
        form=RewardForm.TASK_ONLY,
        alpha=1.0,
        task_features=config.reward.strategy_features,
    )
    return replace(as_printed(config), reward=reward)


def own_rewards(config: MSRDConfig) -> MSRDConfig:
    """AIRL per strategy: a reward of its own for each, nothing shared."""
    return replace(config, reward=replace(config.reward, form=RewardForm.STRATEGY_ONLY, alpha=1.0))


_CHANGES: dict[Method, Callable[[MSRDConfig], MSRDConfig]] = {
    Method.AIRL: pooled_reward,
    Method.AIRL_EACH: lambda config: own_rewards(as_printed(config)),
    Method.AIRL_EACH_CROSS: own_rewards,
    Method.MSRD_AS_PRINTED: as_printed,
}


def make_training(method: Method, data: StudyData, budget: Budget, seed: int) -> StrokeTraining:
    """The training run of a method, before its first step."""
    settings = StrokeTrainingConfig(
        iterations=budget.iterations,
        episodes=budget.episodes,
        seed=seed,
        threads=budget.threads,
        corrective_cloning=method in CORRECTIVE_START,
        strategy_rewards="stroke" if method is Method.MSRD_PER_STROKE else "side_and_stroke",
        **(RANDOMISED if method is Method.MSRD_RANDOMISED else {}),
    )
    training = StrokeTraining(data.training, data.landing_points, settings)
    change = _CHANGES.get(method)
    config = change(training.trainer.config) if change else training.trainer.config
    steps = config.cloning.steps if method in CORRECTIVE_START else budget.plain_cloning_steps
    if budget.cloning_steps is not None:
        steps = budget.cloning_steps
    config = replace(config, cloning=replace(config.cloning, steps=steps))
    if config != training.trainer.config:
        collector = BatchedCollector(training.simulator)
        training.trainer = MSRD(config, training.demonstrations, collector, seed)
    return training


def learn(
    method: Method,
    data: StudyData,
    budget: Budget,
    seed: int,
    progress: Progress,
    frozen: dict[str, Tensor] | None = None,
) -> Learned:
    """Run a method.

    Parameters
    ----------
    frozen
        For `Method.FROZEN_REWARD`: the weights of MSRD's rewards refitted on replay.
    """
    training = make_training(method, data, budget, seed)
    trainer = training.trainer
    iterations = 0 if method in UNPLAYED else budget.iterations
    curve: list[dict[str, Any]] = []
    evaluations = np.random.default_rng((seed, 1))
    begun, begun_cpu, evaluated, evaluated_cpu = time.perf_counter(), time.process_time(), 0.0, 0.0

    def evaluate(iteration: int) -> None:
        nonlocal evaluated, evaluated_cpu
        start, start_cpu = time.perf_counter(), time.process_time()
        struck, returned = training.evaluate(budget.evaluation_balls, evaluations)
        seconds = start - begun - evaluated
        curve.append(
            {
                "iteration": iteration,
                "seconds": seconds,
                "struck": struck.tolist(),
                "returned": returned.tolist(),
            }
        )
        share = 100 * float(returned.mean())
        progress(
            f"{method}, training seed {seed}: iteration {iteration} of {iterations}, {share:.0f} % returned"
        )
        evaluated += time.perf_counter() - start
        evaluated_cpu += time.process_time() - start_cpu

    trainer.clone()
    evaluate(0)
    make_iteration: Callable[[], object] = trainer.iterate
    if method is Method.FROZEN_REWARD:
        assert frozen is not None
        make_iteration = FrozenRewardTraining(training, frozen, seed).iterate
    for index in range(1, iterations + 1):
        make_iteration()
        if index % budget.evaluate_every == 0 or index == iterations:
            evaluate(index)
    report = {
        "curve": curve,
        "seconds": time.perf_counter() - begun - evaluated,
        "cpu_seconds": time.process_time() - begun_cpu - evaluated_cpu,
        "env_steps": trainer.environment_steps,
    }
    has_rewards = method not in (*UNPLAYED, Method.FROZEN_REWARD)
    rewards = dict(trainer.averaged_rewards.state_dict()) if has_rewards else {}
    lasting = {}
    if method is Method.MSRD:
        steps = min(REFIT_STEPS, iterations * trainer.config.discriminator.steps)
        lasting = dict(trainer.refit_on_replay(steps).state_dict())
    return Learned(training.policies(), rewards, lasting, report)


class FrozenRewardTraining:
    """Cloned policies improved on rewards that stay as they are.

    The reward of a step is ``R_i - PRIOR_WEIGHT * (log pi_i - log pi_i of the clone)``, whose optimum stays
    near the clone in the sense of the Kullback-Leibler divergence (as in fine-tuning of language models).

    Parameters
    ----------
    training
        Its policies are improved.
    rewards
        Weights of R0 and S_i.
    seed
        Of rollouts and updates.
    """

    def __init__(self, training: StrokeTraining, rewards: dict[str, Tensor], seed: int) -> None:
        trainer = training.trainer
        config = trainer.config
        self._trainer = trainer
        self._rewards: RewardModel = trainer.averaged_rewards
        self._rewards.load_state_dict(rewards)
        self._clone = copy.deepcopy(trainer.policies)
        self._collector = BatchedCollector(training.simulator)
        self._rng = np.random.default_rng((seed, 2))
        self._iterations = 0
        self._improvement = PolicyImprovement(
            trainer.policies,
            config.policy.features.build(training.demonstrations),
            config.trust_region,
            config.value,
            config.discount,
            config.gae_decay,
            torch.Generator().manual_seed(seed),
        )

    def iterate(self) -> None:
        """Play, reward, improve."""
        config = self._trainer.config
        rollouts = self._collector.collect(self._trainer.policies, config.episodes, self._rng)
        self._trainer.environment_steps += rollouts.observations[:, :, 1:, 0].size
        transitions = Transitions.of(
            torch.as_tensor(rollouts.observations),
            torch.as_tensor(rollouts.actions),
            torch.as_tensor(rollouts.log_probs),
        )
        with torch.no_grad():
            cloned = self._clone.distribution(transitions.observation)
            strayed = transitions.log_prob - self._clone.log_prob(cloned, transitions.action)
            reward = self._rewards(transitions).combined
            reward = reward - PRIOR_WEIGHT * strayed * (1.0 - transitions.passive)
        reward = reward.reshape(*rollouts.actions.shape[:2], -1)
        self._improvement.improve(rollouts, reward, self._iterations / max(1, config.iterations - 1))
        self._iterations += 1
