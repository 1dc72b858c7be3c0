"""Plain reinforcement learning of many policies at once, for rewards that are given rather than inferred."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.policy_improvement import PolicyImprovement
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig


class RewardSource(Protocol):
    """Rewards of rollouts; it may learn from them first."""

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Reward of every transition, ``[S, K, T]``."""
        ...


class PolicyTraining:
    """TRPO with entropy bonus on a `RewardSource`.

    Parameters
    ----------
    policies
        Improved in place.
    features
        What the value functions see.
    source
        Where the reward comes from.
    collector
        Where the policies are played; may be exchanged between iterations.
    episodes
        Rollouts per policy and iteration.
    trust_region, value
        Settings.
    seed
        Everything random follows from it.
    discount, gae_decay
        gamma and lambda of the advantages.
    """

    def __init__(
        self,
        policies: Policies,
        features: Features,
        source: RewardSource,
        collector: Collector,
        episodes: int,
        trust_region: TrustRegionConfig,
        value: ValueConfig,
        seed: int,
        discount: float = 0.99,
        gae_decay: float = 0.97,
    ) -> None:
        self.policies = policies
        self.collector = collector
        self.environment_steps = 0
        self._source = source
        self.episodes = episodes
        self._rng = np.random.default_rng([seed, 1])
        generator = torch.Generator().manual_seed(seed)
        self._improvement = PolicyImprovement(
            policies, features, trust_region, value, discount, gae_decay, generator
        )

    def iterate(self) -> dict[str, float]:
        """Play, reward, improve."""
        started = time.perf_counter()
        rollouts = self.collector.collect(self.policies, self.episodes, self._rng)
        self.environment_steps += rollouts.played_steps
        reward = self._source.reward(rollouts, self.policies)
        metrics = self._improvement.improve(rollouts, reward)
        metrics["reward"] = float(reward.mean())
        metrics["seconds"] = time.perf_counter() - started
        return metrics
