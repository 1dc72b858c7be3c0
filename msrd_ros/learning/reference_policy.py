"""A price on leaving the policies that cloning left."""

from __future__ import annotations

import copy
from typing import Any

import torch
from torch import Tensor

from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Transitions


class ReferencePolicy:
    """Policies as they were once, to stay near.

    The optimum of ``R_i - price * (log pi_i - log pi_ref)`` is that of the reward with a price on the
    Kullback-Leibler divergence from the reference, sampled, as in the fine-tuning of language models
    (Jaques et al. 2017).

    Parameters
    ----------
    policies
        Copied.
    price
        Of a nat.
    """

    def __init__(self, policies: Policies, price: float) -> None:
        self._policies = copy.deepcopy(policies)
        self.price = price

    def charge(self, reward: Tensor, transitions: Transitions, policies: Policies) -> Tensor:
        """What ``reward [S, N]`` is once the price is paid."""
        return reward - self.cost(transitions, policies) if self.price else reward

    @torch.no_grad()
    def cost(self, transitions: Transitions, policies: Policies) -> Tensor:
        """What ``[S, N]`` steps of policies cost, ``[S, N]``; nothing where nobody acts."""
        present, reference = (
            one.log_prob(one.distribution(transitions.observation), transitions.action)
            for one in (policies, self._policies)
        )
        return self.price * (present - reference) * (1.0 - transitions.passive)

    def state_dict(self) -> dict[str, Any]:
        """The reference's weights."""
        return self._policies.state_dict()

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up the weights of `state_dict`."""
        self._policies.load_state_dict(state)
