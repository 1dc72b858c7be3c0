"""A rival without any inverse reinforcement learning: which strategy does a state belong to?"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.replay import DemonstrationPool


class StrategyClassifier:
    """Softmax classifier q(i|s) on the demonstrations' states.

    Parameters
    ----------
    strategies
        Number of classes, S.
    features
        What it sees of an observation.
    hidden
        Widths of the hidden layers.
    generator
        Source of initial weights and minibatches.
    """

    def __init__(
        self, strategies: int, features: Features, hidden: tuple[int, ...], generator: torch.Generator
    ) -> None:
        self._strategies = strategies
        self._features = features
        self._generator = generator
        self.network = BatchedMLP(1, (features.width, *hidden, strategies), generator)

    def fit(
        self,
        demonstrations: DemonstrationPool,
        steps: int = 2500,
        batch: int = 64,
        learning_rate: float = 4e-3,
        weight_decay: float = 1e-4,
    ) -> float:
        """Adam on the cross entropy, the rate falling linearly to a tenth; returns the last loss in nats."""
        parameters = self.network.parameters()
        optimiser = torch.optim.Adam(parameters, lr=learning_rate, weight_decay=weight_decay)
        chosen = demonstrations.choose(None, self._generator)
        target = torch.arange(self._strategies).repeat_interleave(batch)
        loss = torch.zeros(())
        for step in range(steps):
            optimiser.param_groups[0]["lr"] = learning_rate * (1.0 - 0.9 * step / steps)
            sample = demonstrations.sample(chosen, batch, self._generator).next_observation
            logits = self.network(self._features(sample.reshape(1, -1, sample.shape[-1])))[0]
            loss = cross_entropy(logits, target)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        return float(loss.detach())

    @torch.no_grad()
    def log_posterior(self, observations: Tensor) -> Tensor:
        """log q(i|s) of ``observations [N, O]`` for every strategy, ``[S, N]``."""
        logits = self.network(self._features(observations.unsqueeze(0)))[0]
        return torch.log_softmax(logits, dim=-1).T
