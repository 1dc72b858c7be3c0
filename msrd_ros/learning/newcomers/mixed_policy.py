"""Learned policies as one: the weighted mean of what they would do, as something that can be played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.policy import Policy


@dataclass(frozen=True)
class MixedPolicy:
    """Plays ``sum_i w_i mu_i(s)``; of `Policies` what a collector needs, of one strategy.

    Attributes
    ----------
    parts
        Weights, which sum to 1, and policies.
    noise
        Factor on the policies' own deviations when actions are drawn; 0 plays the means.
    scale
        How the environment's actions follow from those that a collector gives it; None: they are the same.
    """

    parts: Sequence[tuple[float, Policy]]
    noise: float = 0.0
    scale: ActionScale | None = None
    strategies: int = 1

    @property
    def action_width(self) -> int:
        """A."""
        return int(self.parts[0][1].log_std.size)

    @property
    def noise_width(self) -> int:
        """Random numbers that one action takes."""
        return self.action_width

    def mean(self, observations: NDArray[np.floating]) -> NDArray[np.float64]:
        """Of ``observations [..., O]``, ``[..., A]`` in the environment's units."""
        each = [weight * np.asarray(policy.act(observations)) for weight, policy in self.parts]
        return np.asarray(np.sum(each, axis=0), dtype=np.float64)

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Of what is drawn about the mean if `noise` is 1, ``[A]`` in the environment's units."""
        each = [weight * np.exp(policy.log_std) for weight, policy in self.parts]
        return np.asarray(np.sum(each, axis=0), dtype=np.float64)

    def log_prob(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating]
    ) -> NDArray[np.float64]:
        """Log-density of ``actions [..., A]``, in the environment's units, as if `noise` were 1."""
        standard = (actions - self.mean(observations)) / self.deviation
        each = -0.5 * np.square(standard) - np.log(self.deviation) - 0.5 * np.log(2.0 * np.pi)
        return np.asarray(each.sum(axis=-1))

    def act(
        self, observations: NDArray[np.floating], noise: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Actions ``[S, K, A]`` for ``observations [S, K, O]``, in the collector's units."""
        action = self.mean(observations)
        if noise is not None and self.noise:
            action = action + self.noise * self.deviation * noise
        return (action if self.scale is None else self.scale.to_unit(action)).astype(np.float32)

    def rollout_log_probs(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Zeros ``[S, K, T]``: a mixture is judged by where it goes."""
        return np.zeros(actions.shape[:-1], dtype=np.float32)

    def __getattr__(self, name: str) -> Any:
        """Whatever else `Policies` have is for training, which mixtures are not."""
        return _refuse(name)


def _refuse(name: str) -> NoReturn:
    raise AttributeError(f"a mixture of learned policies is played, not trained: it has no {name}")
