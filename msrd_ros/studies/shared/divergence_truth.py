"""The truth about KL-encouraged strategies: how much each differs from the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from torch import Tensor

from msrd_ros.learning.kl_encouraged import pairwise_divergence
from msrd_ros.learning.policies import GaussianPolicies


@dataclass(frozen=True)
class DivergenceTruth:
    """The bounded KL-encouraged reward that the kept strategies were trained on (paper, Equation 9).

    Attributes
    ----------
    candidates
        All policies that were trained together: each was rewarded for differing from every one of them,
        from those not kept as well.
    bound
        Largest divergence of a pair that counts, in nats.
    kept
        Indices of the kept ones.
    """

    candidates: GaussianPolicies
    bound: float
    kept: tuple[int, ...]

    def table(self, states: Tensor) -> Tensor:
        """Of ``states [N, O]``, ``[S, N]``: from 0 to `bound` times the number of other candidates, nats."""
        return pairwise_divergence(self.candidates, states.unsqueeze(0), self.bound)[list(self.kept)]

    def unbounded(self) -> DivergenceTruth:
        """The same without the bound."""
        return replace(self, bound=math.inf)
