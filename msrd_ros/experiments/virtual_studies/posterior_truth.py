"""The truth about DIAYN's strategies: what tells one from the others."""

from __future__ import annotations

import math
from dataclasses import dataclass

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
    """

    posterior: BatchedMLP
    features: Features
    kept: tuple[int, ...]

    @torch.no_grad()
    def table(self, states: Tensor) -> Tensor:
        """Of ``states [N, O]``, ``[S, N]``."""
        logits = self.posterior(self.features(states.unsqueeze(0)))[0]
        log_q = torch.log_softmax(logits, dim=-1).T + math.log(self.posterior.sizes[-1])
        return log_q[list(self.kept)]
