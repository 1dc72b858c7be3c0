"""Rewards that do not change any more, to train fresh policies on."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.studies.shared.estimates import Estimate, Rewards


class FrozenReward:
    """A reward that does not change any more, as a function of the next state.

    Parameters
    ----------
    rewards
        Maps states ``[S, N, O]`` to ``[S, N]``.
    """

    def __init__(self, rewards: Rewards) -> None:
        self._rewards = rewards

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Row i judged by strategy i, ``[S, K, T]``."""
        states = torch.as_tensor(rollouts.observations[:, :, 1:])
        rewards: Tensor = self._rewards(states.flatten(1, 2)).unflatten(1, states.shape[1:3])
        return rewards


def one_each(rewards: Sequence[Rewards]) -> Rewards:
    """Row i judged by reward i, which sees ``[N, O]``."""

    def each(states: Tensor) -> Tensor:
        return torch.stack([reward(row) for reward, row in zip(rewards, states, strict=True)])

    return each


def pessimistic(rewards: Sequence[Rewards]) -> Rewards:
    """Mean less one standard deviation of what several runs inferred.

    Runs agree where demonstrations and generators went and disagree elsewhere: what a fresh policy could
    gain by going there is taken away (as in Coste et al. 2023, on reward models of language models).
    """

    def lower(states: Tensor) -> Tensor:
        values = torch.stack([function(states) for function in rewards])
        return values.mean(dim=0) - values.std(dim=0, correction=0)

    return lower


def frozen_rewards(estimate: Estimate) -> dict[str, Rewards]:
    """What there is to optimise: R0 + S_i, S_i alone, R0 alone."""
    found: dict[str, Rewards] = {}
    if estimate.combined is not None:
        found["R0 + S_i"] = estimate.combined
    if estimate.strategies is not None:
        found["S_i alone"] = estimate.strategies
    if estimate.task is not None:
        found["R0 alone"] = estimate.task
    return found
