"""Policies improved on rewards that stay as they are."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import torch

from msrd_ros.learning.method import Method, Problem
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policy_improvement import PolicyImprovement
from msrd_ros.learning.trajectories import Transitions

PRIOR_WEIGHT = 1.0
"""What leaving the cloned policy costs under frozen rewards, per nat. Without it a stroke that had reached
97 % fell to 44 in 60 iterations, at .2 to 82 in 45: a reward that no discriminator corrects any more is
followed to where it was never told anything. Chosen on another population, as are the steps of refitting."""


class FrozenRewardTraining(MSRD):
    """Clones as MSRD does, then improves the policies on the averaged rewards that it was given.

    The reward of a step is ``R_i - PRIOR_WEIGHT * (log pi_i - log pi_i of the clone)``, whose optimum stays
    near the clone in the sense of the Kullback-Leibler divergence (as in fine-tuning of language models).

    Parameters
    ----------
    problem
        What every method is given; load the rewards into ``averaged_rewards``.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.config, problem.demonstrations, problem.collector, problem.seed)
        self._seed = problem.seed
        self._clone = self.policies
        self._features = problem.config.policy.features.build(problem.demonstrations)

    def clone(self) -> dict[str, float]:
        """Also keep the clone; what follows draws from streams of its own."""
        metrics = super().clone()
        config = self.config
        self._clone = copy.deepcopy(self.policies)
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
        transitions = Transitions.of(
            torch.as_tensor(rollouts.observations),
            torch.as_tensor(rollouts.actions),
            torch.as_tensor(rollouts.log_probs),
        )
        with torch.no_grad():
            cloned = self._clone.distribution(transitions.observation)
            strayed = transitions.log_prob - self._clone.log_prob(cloned, transitions.action)
            reward = self.averaged_rewards(transitions).combined
            reward = reward - PRIOR_WEIGHT * strayed * (1.0 - transitions.passive)
        reward = reward.reshape(*rollouts.actions.shape[:2], -1)
        metrics = self._improvement.improve(rollouts, reward, self.progress)
        self.iterations_done += 1
        return metrics

    def state_dict(self) -> dict[str, Any]:
        """Also of the clone."""
        return {**super().state_dict(), "clone": self._clone.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Also of the clone."""
        super().load_state_dict(state)
        self._clone = copy.deepcopy(self.policies)
        self._clone.load_state_dict(state["clone"])


class FrozenReward(Method):
    """Plain cloning, then TRPO on rewards of another method that nobody corrects any more."""

    name = "frozen_reward"
    title = "plain cloning + frozen R0 + S_i"
    has_rewards = False

    def start(self, problem: Problem) -> FrozenRewardTraining:
        """Without weights of rewards yet."""
        return FrozenRewardTraining(problem)
