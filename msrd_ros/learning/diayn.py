"""DIAYN + extrinsic reward: heterogeneous demonstrators told apart by the states they visit.

Paper, Equation 8 (after Eysenbach et al., 2018), added to the task reward by the form of Equation 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts


class DiaynReward:
    """``R0(s') + weight * max(log q(z|s') - log p(z), floor)`` with q learned along.

    Parameters
    ----------
    strategies
        Number of strategies, S; p(z) is uniform.
    features
        What the posterior q sees of an observation.
    hidden
        Widths of its hidden layers.
    extrinsic
        Task reward of states ``[..., O]``, ``[...]``.
    weight
        Weight of the pseudo-reward.
    floor
        Lower bound of the pseudo-reward, in nats, so that early confusion does not drown the task.
    generator
        Source of initial weights and minibatches.
    steps, batch, learning_rate
        Adam on q per iteration, on `batch` states of every strategy.
    blur
        Standard deviation of noise on the features that q learns from: the resolution of an observer who
        has to tell the strategies apart. Without it q makes strategies out of centimetres.
    """

    def __init__(
        self,
        strategies: int,
        features: Features,
        hidden: tuple[int, ...],
        extrinsic: Callable[[Tensor], Tensor],
        weight: float,
        generator: torch.Generator,
        floor: float = -10.0,
        steps: int = 10,
        batch: int = 64,
        learning_rate: float = 3e-3,
        blur: float = 0.0,
    ) -> None:
        self.posterior = BatchedMLP(1, (features.width, *hidden, strategies), generator)
        self.features = features
        self._strategies = strategies
        self._extrinsic = extrinsic
        self._weight = weight
        self._floor = floor
        self._steps, self._batch = steps, batch
        self._blur = blur
        self._generator = generator
        self.optimiser = torch.optim.Adam(self.posterior.parameters(), lr=learning_rate, weight_decay=1e-4)

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Improve q on the rollouts, then reward them, ``[S, K, T]``."""
        states = torch.as_tensor(rollouts.observations[:, :, 1:])
        self.fit(states.flatten(1, 2))
        strategies, episodes, steps = states.shape[:3]
        pseudo = self.pseudo_reward(states.flatten(1, 2)).reshape(strategies, episodes, steps)
        return self._extrinsic(states) + self._weight * pseudo.clamp(min=self._floor)

    def fit(self, states: Tensor) -> float:
        """Cross entropy of q on ``states [S, N, O]`` of every strategy; returns the last loss in nats."""
        target = torch.arange(self._strategies).repeat_interleave(self._batch)
        loss = torch.zeros(())
        for _ in range(self._steps):
            index = torch.randint(states.shape[1], (self._batch,), generator=self._generator)
            chosen = states[:, index].reshape(1, -1, states.shape[-1])
            features = self.features(chosen)
            if self._blur > 0.0:
                features = features + self._blur * torch.randn(features.shape, generator=self._generator)
            loss = cross_entropy(self.posterior(features)[0], target)
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
        return float(loss.detach())

    @torch.no_grad()
    def log_posterior(self, states: Tensor) -> Tensor:
        """Log q(z|s) of ``states [N, O]`` for every z, ``[S, N]``."""
        return torch.log_softmax(self.posterior(self.features(states.unsqueeze(0)))[0], dim=-1).T

    @torch.no_grad()
    def pseudo_reward(self, states: Tensor) -> Tensor:
        """Equation 8 for ``states [S, N, O]``, row z judged as strategy z, ``[S, N]``."""
        strategies, count, width = states.shape
        logits = self.posterior(self.features(states.reshape(1, -1, width)))[0]
        log_q = torch.log_softmax(logits, dim=-1).reshape(strategies, count, strategies)
        own = log_q[torch.arange(strategies), :, torch.arange(strategies)]
        return own + math.log(strategies)
