"""State values of every strategy: the baseline of the advantages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from msrd_ros.learning.networks import BatchedMLP, Features


@dataclass(frozen=True)
class ValueConfig:
    """Settings of the value functions.

    Attributes
    ----------
    hidden
        Widths of the hidden layers.
    learning_rate, steps, batch
        Adam steps per iteration, each on `batch` samples of every strategy.
    sees_time
        Whether the elapsed share of the horizon is an input (right for short episodes that end).
    bootstrap
        Whether the episode goes on behind the horizon, so that its last state has a value.
    """

    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 3e-3
    steps: int = 20
    batch: int = 512
    sees_time: bool = True
    bootstrap: bool = False


class ValueFunctions:
    """V_i(s, t), fitted by regression on returns standardised per strategy.

    Parameters
    ----------
    strategies
        Number of value functions, S.
    features
        What they see of an observation.
    config
        Settings.
    generator
        Source of initial weights and of minibatches.
    """

    def __init__(
        self, strategies: int, features: Features, config: ValueConfig, generator: torch.Generator
    ) -> None:
        self.config = config
        self._features = features
        self._generator = generator
        sizes = (features.width + int(config.sees_time), *config.hidden, 1)
        self.network = BatchedMLP(strategies, sizes, generator, 0.1)
        self._optimiser = torch.optim.Adam(self.network.parameters(), lr=config.learning_rate, foreach=True)
        self._mean = torch.zeros(strategies, 1)
        self._std = torch.ones(strategies, 1)
        self._fitted = False

    @property
    def fitted(self) -> bool:
        """Whether there has been any regression yet."""
        return self._fitted

    @torch.no_grad()
    def __call__(self, observations: Tensor, time: Tensor) -> Tensor:
        """Values ``[S, N]`` of ``observations [S, N, O]`` at the shares ``time [S, N]`` of the horizon."""
        output = self.network(self._inputs(observations, time)).squeeze(-1)
        return self._mean + self._std * output

    def draw_batches(self, samples: int) -> list[Tensor]:
        """Rows of so many samples for each step of `fit`."""
        size = min(self.config.batch, samples)
        return [torch.randint(samples, (size,), generator=self._generator) for _ in range(self.config.steps)]

    def fit(self, observations: Tensor, time: Tensor, returns: Tensor, batches: list[Tensor]) -> Tensor:
        """Regress on ``returns [S, N]``; gives the standardised squared error before, ``[S]``."""
        mean, std = returns.mean(dim=1, keepdim=True), returns.std(dim=1, keepdim=True) + 1e-6
        rate = 0.1 if self._fitted else 1.0
        self._mean, self._std = torch.lerp(self._mean, mean, rate), torch.lerp(self._std, std, rate)
        self._fitted = True
        inputs = self._inputs(observations, time)
        targets = (returns - self._mean) / self._std
        with torch.no_grad():
            error = (self.network(inputs).squeeze(-1) - targets).square().mean(dim=1)
        for index in batches:
            loss = (self.network(inputs[:, index]).squeeze(-1) - targets[:, index]).square().mean(dim=1).sum()
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()
        return error

    def _inputs(self, observations: Tensor, time: Tensor) -> Tensor:
        features = self._features(observations)
        if not self.config.sees_time:
            return features
        return torch.cat([features, 2.0 * time.unsqueeze(-1) - 1.0], dim=-1)

    def state_dict(self) -> dict[str, Any]:
        """Everything needed to go on exactly."""
        return {
            "network": self.network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "mean": self._mean,
            "std": self._std,
            "fitted": self._fitted,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up a state of `state_dict`."""
        self.network.load_state_dict(state["network"])
        self._optimiser.load_state_dict(state["optimiser"])
        self._mean, self._std, self._fitted = state["mean"], state["std"], bool(state["fitted"])
