"""Gaussian policies of all strategies side by side, with a standard deviation that ignores the state."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from msrd_ros.learning.networks import BatchedMLP, Features, Linearisation


class Metric(Protocol):
    """A Riemannian metric on the parameters, known by its products."""

    def product(self, vector: Tensor) -> Tensor:
        """F v for ``vector [S, P]``."""
        ...


class Policies(Protocol):
    """What learning needs of the policies of all strategies, whatever their distribution.

    Attributes
    ----------
    strategies, action_width, noise_width
        Number of policies, of action columns, and of random numbers that one action takes.
    """

    strategies: int
    action_width: int
    noise_width: int

    def distribution(self, observations: Tensor) -> Any:
        """A named tuple of tensors: the action distributions at ``observations [S, N, O]``."""
        ...

    def log_prob(self, distribution: Any, actions: Tensor) -> Tensor:
        """Log pi_i(a|s), ``[S, N]``."""
        ...

    def entropy(self, distribution: Any) -> Tensor:
        """Mean entropy, ``[S]``, in nats."""
        ...

    def kl(self, old: Any, new: Any) -> Tensor:
        """Mean KL(old || new), ``[S]``, in nats."""
        ...

    def fisher_metric(self, observations: Tensor) -> Metric:
        """The Fisher information, averaged over ``observations [S, N, O]``."""
        ...

    def flat(self) -> Tensor:
        """All parameters, ``[S, P]``."""
        ...

    def set_flat(self, flat: Tensor) -> None:
        """Overwrite all parameters."""
        ...

    def flat_gradient(self, objective: Tensor) -> Tensor:
        """Gradient of a scalar, ``[S, P]``."""
        ...

    def act(
        self, observations: NDArray[np.floating], noise: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Actions ``[S, K, A]`` for ``observations [S, K, O]``; the mean or mode without `noise`."""
        ...

    def rollout_log_probs(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Log pi_i along trajectories, ``[S, K, T]``."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Weights and scaling."""
        ...

    def load_state_dict(self, state: dict[str, Any]) -> Any:
        """Take up a state of `state_dict`."""
        ...


class GaussianDistribution(NamedTuple):
    """Diagonal Gaussians: ``mean [S, N, A]`` and ``log_std [S, 1, A]``."""

    mean: Tensor
    log_std: Tensor


class GaussianPolicies(nn.Module):
    """pi_i(a|s) = N(mu_i(s), diag(sigma_i^2)) for i = 1..S.

    Parameters
    ----------
    strategies
        Number of policies, S.
    features
        What a policy sees of an observation.
    action_width
        Number of action columns, A.
    hidden
        Widths of the hidden layers.
    log_std, log_std_min, log_std_max
        Initial value and bounds of log sigma. Bounds are kept by projection after every update: without
        them sigma runs away while the environment clips the actions.
    generator
        Source of the initial weights.
    """

    def __init__(
        self,
        strategies: int,
        features: Features,
        action_width: int,
        hidden: tuple[int, ...],
        log_std: float,
        log_std_min: float,
        log_std_max: float,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.strategies = strategies
        self.action_width = action_width
        self.noise_width = action_width
        self.log_std_min = log_std_min
        self.log_std_max = log_std_max
        self.features = features
        self.network = BatchedMLP(strategies, (features.width, *hidden, action_width), generator, 0.1)
        self.log_std = nn.Parameter(torch.full((strategies, 1, action_width), log_std))

    def distribution(self, observations: Tensor) -> GaussianDistribution:
        """Action distributions at ``observations [S, N, O]``."""
        return GaussianDistribution(self.network(self.features(observations)), self.log_std)

    def log_prob(self, distribution: GaussianDistribution, actions: Tensor) -> Tensor:
        """Log pi_i(a|s) of ``actions [S, N, A]``, ``[S, N]``."""
        mean, log_std = distribution
        standard = (actions - mean) * torch.exp(-log_std)
        return (-0.5 * standard.square() - log_std - 0.5 * math.log(2.0 * math.pi)).sum(dim=-1)

    def entropy(self, distribution: GaussianDistribution) -> Tensor:
        """H(pi_i(.|s)) averaged over the given states, ``[S]``, in nats."""
        return (distribution.log_std + 0.5 * math.log(2.0 * math.pi * math.e)).sum(dim=-1).mean(dim=1)

    def kl(self, old: GaussianDistribution, new: GaussianDistribution) -> Tensor:
        """KL(old || new), averaged over states, ``[S]``."""
        ratio = torch.exp(2.0 * (old.log_std - new.log_std))
        shift = (old.mean - new.mean).square() * torch.exp(-2.0 * new.log_std)
        return (0.5 * (ratio + shift - 1.0) + new.log_std - old.log_std).sum(dim=-1).mean(dim=1)

    def fisher_metric(self, observations: Tensor) -> FisherMetric:
        """The Fisher information at ``observations [S, N, O]``, ready for products."""
        return FisherMetric(self, Linearisation(self.network, self.features(observations)))

    def flat(self) -> Tensor:
        """All parameters, one row per strategy: network, then log sigma, ``[S, P]``."""
        return torch.cat([self.network.flat(), self.log_std.detach().flatten(1)], dim=1)

    def set_flat(self, flat: Tensor) -> None:
        """Overwrite all parameters, then project log sigma into its bounds."""
        split = self.network.parameter_count
        self.network.set_flat(flat[:, :split])
        with torch.no_grad():
            log_std = flat[:, split:].reshape(self.log_std.shape)
            self.log_std.copy_(log_std.clamp(self.log_std_min, self.log_std_max))

    def flat_gradient(self, objective: Tensor) -> Tensor:
        """Gradient of the scalar `objective`, ``[S, P]`` in the order of `flat`."""
        pairs = zip(self.network.weights, self.network.biases, strict=True)
        parameters = [*(part for pair in pairs for part in pair), self.log_std]
        gradients = torch.autograd.grad(objective, parameters, allow_unused=True)
        filled = [
            torch.zeros_like(parameter) if gradient is None else gradient
            for parameter, gradient in zip(parameters, gradients, strict=True)
        ]
        return torch.cat([gradient.flatten(1) for gradient in filled], dim=1)

    @torch.no_grad()
    def act(
        self, observations: NDArray[np.floating], noise: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Actions for ``observations [S, K, O]``.

        Parameters
        ----------
        noise
            Standard normal draws ``[S, K, A]``; None plays the mean.

        Returns
        -------
        NDArray
            ``[S, K, A]`` float32, not clipped.
        """
        mean = self.network(self.features(torch.as_tensor(observations, dtype=torch.float32)))
        if noise is not None:
            mean = mean + torch.exp(self.log_std) * torch.as_tensor(noise, dtype=torch.float32)
        actions: NDArray[np.float32] = mean.numpy()
        return actions

    @torch.no_grad()
    def rollout_log_probs(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Log pi_i of ``actions [S, K, T, A]`` at ``observations [S, K, T, O]``, ``[S, K, T]``."""
        strategies, count, steps = actions.shape[:3]
        states = torch.as_tensor(observations, dtype=torch.float32).flatten(1, 2)
        drawn = torch.as_tensor(actions, dtype=torch.float32).flatten(1, 2)
        values = self.log_prob(self.distribution(states), drawn)
        return values.reshape(strategies, count, steps).numpy()


class FisherMetric:
    """Fisher information of Gaussian policies, averaged over states, one block per strategy.

    F = E[J^T diag(1 / sigma^2) J] for the network with Jacobian J of the mean, and 2 I for log sigma.
    """

    def __init__(self, policies: GaussianPolicies, means: Linearisation) -> None:
        self._parameters = policies.network.parameter_count
        self._means = means
        self._precision = torch.exp(-2.0 * policies.log_std.detach()) / means.outputs.shape[1]

    @torch.no_grad()
    def product(self, vector: Tensor) -> Tensor:
        """F v for ``vector [S, P]``."""
        tangent = self._means.push_forward(vector[:, : self._parameters])
        network = self._means.pull_back(tangent.mul_(self._precision))
        return torch.cat([network, 2.0 * vector[:, self._parameters :]], dim=1)
