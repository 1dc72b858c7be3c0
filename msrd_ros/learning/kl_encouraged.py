"""KL-encouraged + extrinsic reward: demonstrators told apart by what they do in the same state.

Paper, Equation 9. As printed the sum grows without bound (two policies can drift apart for ever), so each
pair's divergence is bounded.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from msrd_ros.learning.policies import GaussianDistribution, GaussianPolicies, Policies
from msrd_ros.learning.trajectories import Rollouts


def pairwise_divergence(policies: GaussianPolicies, states: Tensor, bound: float) -> Tensor:
    """``sum_i min(KL(pi_k(.|s) || pi_i(.|s)), bound)`` for every k, ``[S, N]`` (paper, Equation 9).

    Parameters
    ----------
    states
        ``[S, N, O]``, row k judged as strategy k; broadcast from ``[1, N, O]`` to judge the same states.
    bound
        Largest divergence of a pair that counts, in nats.
    """
    strategies, shared = policies.strategies, states.shape[0] == 1
    states = states.expand(strategies, -1, -1)
    with torch.no_grad():
        own = policies.distribution(states)
        total = torch.zeros(states.shape[:2])
        for shift in range(1, strategies):
            other = _roll(own, shift) if shared else _others(policies, states, shift)
            ratio = torch.exp(2.0 * (own.log_std - other.log_std))
            moved = (own.mean - other.mean).square() * torch.exp(-2.0 * other.log_std)
            pair = 0.5 * (ratio + moved - 1.0) + other.log_std - own.log_std
            total += pair.sum(dim=-1).clamp(max=bound)
    return total


def _roll(distribution: GaussianDistribution, shift: int) -> GaussianDistribution:
    """Row k becomes row ``k + shift``."""
    return GaussianDistribution(*(part.roll(-shift, dims=0) for part in distribution))


def _others(policies: GaussianPolicies, states: Tensor, shift: int) -> GaussianDistribution:
    """Distributions of strategy ``k + shift`` at the states of strategy k."""
    return _roll(policies.distribution(states.roll(shift, dims=0)), shift)


class KLEncouragedReward:
    """``R0(s') + weight * sum_i min(KL(pi_k(.|s') || pi_i(.|s')), bound)``.

    Parameters
    ----------
    extrinsic
        Task reward of states ``[..., O]``, ``[...]``.
    weight
        Weight of the diversity reward.
    bound
        Largest divergence of a pair that counts, in nats.
    """

    def __init__(self, extrinsic: Callable[[Tensor], Tensor], weight: float, bound: float) -> None:
        self._extrinsic = extrinsic
        self._weight = weight
        self._bound = bound

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Reward of every transition, ``[S, K, T]``."""
        if not isinstance(policies, GaussianPolicies):
            raise TypeError("the KL-encouraged reward needs Gaussian policies")
        states = torch.as_tensor(rollouts.observations[:, :, 1:])
        strategies, episodes, steps = states.shape[:3]
        diversity = pairwise_divergence(policies, states.flatten(1, 2), self._bound)
        return self._extrinsic(states) + self._weight * diversity.reshape(strategies, episodes, steps)
