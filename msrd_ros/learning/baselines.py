"""What networks learn from demonstrations without inverse reinforcement learning: rivals and yardsticks."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy, mse_loss

from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.replay import DemonstrationPool


class _StateNetwork:
    """A number per strategy, learned from the states of demonstrations.

    Parameters
    ----------
    strategies
        Number of outputs, S.
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

    def _minimise(
        self,
        demonstrations: DemonstrationPool,
        loss_of: Callable[[Tensor, Tensor], Tensor],
        steps: int,
        batch: int,
        learning_rate: float,
        weight_decay: float = 1e-4,
    ) -> float:
        """Adam, the rate falling linearly to a tenth; returns the last loss.

        `loss_of` gets outputs ``[S * batch, S]`` and states ``[S * batch, O]``, strategy by strategy.
        """
        parameters = self.network.parameters()
        optimiser = torch.optim.Adam(parameters, lr=learning_rate, weight_decay=weight_decay)
        chosen = demonstrations.choose(None, self._generator)
        loss = torch.zeros(())
        for step in range(steps):
            optimiser.param_groups[0]["lr"] = learning_rate * (1.0 - 0.9 * step / steps)
            states = demonstrations.sample(chosen, batch, self._generator).next_observation.flatten(0, 1)
            loss = loss_of(self._outputs(states), states)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        return float(loss.detach())

    def _outputs(self, states: Tensor) -> Tensor:
        """Of ``states [N, O]``, ``[N, S]``."""
        outputs: Tensor = self.network(self._features(states.unsqueeze(0)))[0]
        return outputs


class StrategyClassifier(_StateNetwork):
    """Softmax classifier q(i|s) on the demonstrations' states: which strategy a state belongs to."""

    def fit(
        self,
        demonstrations: DemonstrationPool,
        steps: int = 2500,
        batch: int = 64,
        learning_rate: float = 4e-3,
    ) -> float:
        """Adam on the cross entropy; returns the last loss in nats."""
        target = torch.arange(self._strategies).repeat_interleave(batch)

        def loss(logits: Tensor, _: Tensor) -> Tensor:
            return cross_entropy(logits, target)

        return self._minimise(demonstrations, loss, steps, batch, learning_rate)

    @torch.no_grad()
    def log_posterior(self, observations: Tensor) -> Tensor:
        """Log q(i|s) of ``observations [N, O]`` for every strategy, ``[S, N]``."""
        return torch.log_softmax(self._outputs(observations), dim=-1).T


class SupervisedRewards(_StateNetwork):
    """Not a method but a yardstick: regression on the true strategy rewards of all demonstrated states.

    Nobody who has only demonstrations knows more about the preferences than this. Where it is wrong, the
    demonstrations do not tell.

    Attributes
    ----------
    bounds
        Lowest and highest reward that it can say, ``[2]``: those of the demonstrations it was taught on.
    """

    bounds: Tensor

    def fit(
        self,
        demonstrations: DemonstrationPool,
        truth: Callable[[Tensor], Tensor],
        steps: int = 2500,
        batch: int = 64,
        learning_rate: float = 4e-3,
    ) -> float:
        """Adam on the squared error, in units of the range of the truth; returns the last loss.

        Parameters
        ----------
        truth
            True rewards of states ``[N, O]`` for every strategy, ``[S, N]``.
        """
        chosen = demonstrations.choose(None, self._generator)
        seen = truth(demonstrations.sample(chosen, 1000, self._generator).next_observation.flatten(0, 1))
        self.bounds = torch.stack([seen.min(), seen.max()])
        low, high = self.bounds

        def error(outputs: Tensor, states: Tensor) -> Tensor:
            return mse_loss(outputs, (truth(states).T - low) / (high - low))

        return self._minimise(demonstrations, error, steps, batch, learning_rate)

    @torch.no_grad()
    def table(self, observations: Tensor) -> Tensor:
        """Rewards of ``observations [N, O]`` for every strategy, ``[S, N]``."""
        low, high = self.bounds
        rewards: Tensor = low + (high - low) * self._outputs(observations)
        return rewards.clamp(low, high).T
