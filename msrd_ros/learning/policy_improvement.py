"""Algorithm 1, line 10: from rewarded rollouts to better policies, whatever gave the reward."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import torch
from torch import Tensor

from msrd_ros.learning.advantages import credit_masked_rewards, generalised_advantages
from msrd_ros.learning.endings import acting_rows, hold_endings
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig, draw_fisher_rows, trust_region_step
from msrd_ros.learning.value import ValueConfig, ValueFunctions


class PolicyImprovement:
    """Advantages, one trust-region step, and a better baseline for the next time.

    Parameters
    ----------
    policies
        The policies to improve, in place.
    features
        What the value functions see.
    trust_region, value
        Settings of the two.
    discount, gae_decay
        gamma and lambda of the advantages.
    generator
        Source of everything random.
    """

    def __init__(
        self,
        policies: Policies,
        features: Features,
        trust_region: TrustRegionConfig,
        value: ValueConfig,
        discount: float,
        gae_decay: float,
        generator: torch.Generator,
    ) -> None:
        self._policies = policies
        self._trust_region = trust_region
        self._discount = discount
        self._gae_decay = gae_decay
        self._generator = generator
        self.value = ValueFunctions(policies.strategies, features, value, generator)

    def improve(self, rollouts: Rollouts, reward: Tensor, progress: float = 0.0) -> dict[str, float]:
        """One update.

        Parameters
        ----------
        rollouts
            Drawn by the current policies.
        reward
            ``[S, K, T]`` of every transition, passive ones included.
        progress
            Share of the planned iterations that are done, for the schedule of the trust region.

        Returns
        -------
        dict
            Mean KL moved, share of strategies that moved, entropy (nats), standardised value error.
        """
        discount = self._discount
        strategies, episodes, acting = rollouts.actions.shape[:3]
        horizon = rollouts.observations.shape[2] - 1
        observations = torch.as_tensor(rollouts.observations[:, :, : acting + 1])
        clock = (torch.arange(acting + 1) / horizon).expand(strategies, episodes, acting + 1)
        states, times = observations[:, :, :acting].flatten(1, 2), clock[:, :, :acting].flatten(1, 2)
        actions = torch.as_tensor(rollouts.actions).flatten(1, 2)
        reward = credit_masked_rewards(reward, acting, discount)
        chosen = acting_rows(rollouts)
        states, times, actions = chosen(states), chosen(times), chosen(actions)

        if not self.value.fitted:
            nothing = torch.zeros(strategies, episodes, acting + 1)
            returns = generalised_advantages(reward, nothing, discount, 1.0)
            batches = self.value.draw_batches(states.shape[1])
            self.value.fit(states, times, chosen(returns.flatten(1, 2)), batches)
        values = self.value(observations.flatten(1, 2), clock.flatten(1, 2))
        values = values.reshape(strategies, episodes, acting + 1)
        if not self.value.config.bootstrap:
            values[:, :, -1] = 0.0
        reward, values = hold_endings(rollouts, reward, values, discount, self.value.config.bootstrap)
        advantages = generalised_advantages(reward, values, discount, self._gae_decay)
        advantages = chosen(advantages.flatten(1, 2))
        deviation = advantages.std(dim=1, keepdim=True) + 1e-8
        advantages = (advantages - advantages.mean(dim=1, keepdim=True)) / deviation

        shrink = 1.0 - (1.0 - self._trust_region.kl_end) * progress
        trust_region = replace(self._trust_region, kl=self._trust_region.kl * shrink)
        returns = generalised_advantages(reward, values, discount, 1.0) + values[:, :, :-1]
        # Neither waits for the other, and each is too small to be shared out: two cores do them side by side.
        # What is random is drawn before, so that it does not depend on who is first.
        fisher_rows = draw_fisher_rows(states.shape[1], trust_region, self._generator)
        batches = self.value.draw_batches(states.shape[1])
        with ThreadPoolExecutor(1) as beside:
            fitting = beside.submit(self.value.fit, states, times, chosen(returns.flatten(1, 2)), batches)
            report = trust_region_step(self._policies, states, actions, advantages, trust_region, fisher_rows)
            error = fitting.result()
        with torch.no_grad():
            entropy = self._policies.entropy(self._policies.distribution(states[:, :1]))
        return {
            "kl": float(report.kl.mean()),
            "steps_accepted": float(report.accepted.float().mean()),
            "entropy": float(entropy.mean()),
            "value_error": float(error.mean()),
        }
