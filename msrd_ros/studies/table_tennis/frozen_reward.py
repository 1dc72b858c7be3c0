"""Policies improved on rewards that stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method, Problem
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policy_improvement import PolicyImprovement

REFERENCE_PRICE = 1.0
"""Without any a stroke that had reached 97 % fell to 44 in 60 iterations, at .2 to 82 in 45: a reward that no
discriminator corrects any more is followed to where it was never told anything. Chosen on another population,
as are the steps of refitting."""


class FrozenRewardTraining(MSRD):
    """Clones as MSRD does, then improves the policies on the averaged rewards that it was given.

    Parameters
    ----------
    problem
        What every method is given; load the rewards into ``averaged_rewards``.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.config, problem.demonstrations, problem.collector, problem.seed)
        self._seed = problem.seed
        self._features = problem.config.policy.features.build(problem.demonstrations)

    def clone(self) -> dict[str, float]:
        """What follows draws from streams of its own."""
        metrics = super().clone()
        config = self.config
        self._rng = np.random.default_rng((self._seed, 2))
        self._improvement = PolicyImprovement(
            self.policies,
            self._features,
            config.trust_region,
            config.value,
            config.discount,
            config.gae_decay,
            torch.Generator().manual_seed(self._seed),
        )
        return metrics

    def iterate(self) -> dict[str, float]:
        """Play, reward, improve."""
        rollouts = self._collect(self.config.episodes, self._collector)
        transitions = self._transitions(rollouts)
        with torch.no_grad():
            reward = self.averaged_rewards(transitions).combined
            reward = reward - self._reference.cost(transitions, self.policies)
        reward = reward.reshape(*rollouts.actions.shape[:2], -1)
        metrics = self._improvement.improve(rollouts, reward, self.progress)
        self.iterations_done += 1
        return metrics


class FrozenReward(Method):
    """Plain cloning, then TRPO on rewards of another method that nobody corrects any more."""

    name = "frozen_reward"
    title = "plain cloning + frozen R0 + S_i"
    has_rewards = False

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """A price on leaving the clones."""
        return replace(config, policy=replace(config.policy, reference_price=REFERENCE_PRICE))

    def start(self, problem: Problem) -> FrozenRewardTraining:
        """Without weights of rewards yet."""
        config = self.configure(problem.config, problem.demonstrations.strategies)
        return FrozenRewardTraining(replace(problem, config=config))
