"""Policies over a finite set of actions, with the same interface as the Gaussian ones.

Actions are one column holding the action's index. With one-hot observations and no hidden layer the
policies are tables, so that MSRD can be tried on problems whose solution is known exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from msrd_ros.learning.networks import BatchedMLP, Features, Linearisation


class CategoricalDistribution(NamedTuple):
    """Normalised ``log_probs [S, N, C]`` of C actions."""

    log_probs: Tensor


class CategoricalPolicies(nn.Module):
    """pi_i(a|s) = softmax(logits_i(s))[a] for i = 1..S.

    Parameters
    ----------
    strategies
        Number of policies, S.
    features
        What a policy sees of an observation.
    choices
        Number of actions, C.
    hidden
        Widths of the hidden layers; ``()`` gives linear logits.
    generator
        Source of the initial weights.
    """

    action_width = 1
    noise_width = 1

    def __init__(
        self,
        strategies: int,
        features: Features,
        choices: int,
        hidden: tuple[int, ...],
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.strategies = strategies
        self.features = features
        self.network = BatchedMLP(strategies, (features.width, *hidden, choices), generator, 0.1)

    def distribution(self, observations: Tensor) -> CategoricalDistribution:
        """Action distributions at ``observations [S, N, O]``."""
        return CategoricalDistribution(torch.log_softmax(self.network(self.features(observations)), dim=-1))

    def log_prob(self, distribution: CategoricalDistribution, actions: Tensor) -> Tensor:
        """Log pi_i(a|s) of action indices ``[S, N, 1]``, ``[S, N]``."""
        return torch.gather(distribution.log_probs, -1, actions.long()).squeeze(-1)

    def entropy(self, distribution: CategoricalDistribution) -> Tensor:
        """H(pi_i(.|s)) averaged over the given states, ``[S]``, in nats."""
        return -(distribution.log_probs.exp() * distribution.log_probs).sum(dim=-1).mean(dim=1)

    def kl(self, old: CategoricalDistribution, new: CategoricalDistribution) -> Tensor:
        """KL(old || new), averaged over states, ``[S]``."""
        return (old.log_probs.exp() * (old.log_probs - new.log_probs)).sum(dim=-1).mean(dim=1)

    def fisher_metric(self, observations: Tensor) -> CategoricalFisherMetric:
        """The Fisher information at ``observations [S, N, O]``, ready for products."""
        return CategoricalFisherMetric(Linearisation(self.network, self.features(observations)))

    def flat(self) -> Tensor:
        """All parameters, one row per strategy, ``[S, P]``."""
        return self.network.flat()

    def set_flat(self, flat: Tensor) -> None:
        """Overwrite all parameters."""
        self.network.set_flat(flat)

    def flat_gradient(self, objective: Tensor) -> Tensor:
        """Gradient of the scalar `objective`, ``[S, P]`` in the order of `flat`."""
        pairs = zip(self.network.weights, self.network.biases, strict=True)
        gradients = torch.autograd.grad(objective, [part for pair in pairs for part in pair])
        return torch.cat([gradient.flatten(1) for gradient in gradients], dim=1)

    @torch.no_grad()
    def act(
        self, observations: NDArray[np.floating], noise: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Action indices ``[S, K, 1]``; `noise` as for Gaussian policies, None plays the likeliest."""
        states = torch.as_tensor(observations, dtype=torch.float32)
        log_probs: Tensor = self.distribution(states).log_probs
        if noise is None:
            return log_probs.argmax(dim=-1, keepdim=True).to(torch.float32).numpy()
        uniform = torch.special.ndtr(torch.as_tensor(noise, dtype=torch.float64))
        beneath: Tensor = (log_probs.exp().double().cumsum(dim=-1) < uniform).sum(dim=-1, keepdim=True)
        return beneath.clamp(max=log_probs.shape[-1] - 1).to(torch.float32).numpy()

    @torch.no_grad()
    def rollout_log_probs(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Log pi_i of ``actions [S, K, T, 1]`` at ``observations [S, K, T, O]``, ``[S, K, T]``."""
        strategies, count, steps = actions.shape[:3]
        states = torch.as_tensor(observations, dtype=torch.float32).flatten(1, 2)
        values = self.log_prob(self.distribution(states), torch.as_tensor(actions).flatten(1, 2))
        return values.reshape(strategies, count, steps).numpy()


class CategoricalFisherMetric:
    """F = E[J^T (diag(p) - p p^T) J] with the Jacobian J of the logits, one block per strategy."""

    def __init__(self, logits: Linearisation) -> None:
        self._logits = logits
        self._probs = torch.softmax(logits.outputs, dim=-1)

    @torch.no_grad()
    def product(self, vector: Tensor) -> Tensor:
        """F v for ``vector [S, P]``."""
        weighted = self._probs * self._logits.push_forward(vector)
        centred = weighted - self._probs * weighted.sum(dim=-1, keepdim=True)
        return self._logits.pull_back(centred / centred.shape[1])
