"""The truth about DIAYN's strategies: what tells one from the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from msrd_ros.learning.networks import BatchedMLP, Features


@dataclass(frozen=True)
class PosteriorTruth:
    """DIAYN's pseudo-reward ``log q(z|s) - log p(z)`` of the kept strategies (paper, Equation 8).

    Attributes
    ----------
    posterior
        q over all strategies that were trained.
    features
        What it sees of a state.
    kept
        Indices of the kept ones.
    floor
        Lower bound in nats: that of `learning.diayn.DiaynReward` gives the pseudo-reward as it was paid.
        Below it nobody preferred anything, and log q only says how fast a network grows where it has
        seen nobody.
    """

    posterior: BatchedMLP
    features: Features
    kept: tuple[int, ...]
    floor: float = -math.inf

    @torch.no_grad()
    def table(self, states: Tensor) -> Tensor:
        """Of ``states [N, O]``, ``[S, N]``."""
        logits = self.posterior(self.features(states.unsqueeze(0)))[0]
        log_q = torch.log_softmax(logits, dim=-1).T + math.log(self.posterior.sizes[-1])
        return log_q[list(self.kept)].clamp(min=self.floor)

    def unbounded(self) -> PosteriorTruth:
        """The same without the floor."""
        return replace(self, floor=-math.inf)
