"""States that nobody shows and nobody visits, as further negatives.

The discriminator learns where demonstrations are told from rollouts, and nothing of any other place: there
R0 is whatever the network makes up, and a policy, another world or a judge of other trajectories gets there.
Contrast with a broad density settles it (noise-contrastive estimation: Gutmann and Hyvärinen, 2010).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.trajectories import Transitions

LEAST, MOST = 0.03, 10.0
"""Size of an offset, in deviations of the demonstrated column: log-uniform between, for each column on its
own, so that states which are odd in one column alone are among them as well as those that are odd in all."""


class Displacement:
    """Moves transitions to demonstrated states with random offsets.

    Parameters
    ----------
    pool
        The demonstrations; the states of all strategies count alike.
    """

    def __init__(self, pool: DemonstrationPool) -> None:
        self._states = pool.states()
        self._deviation = self._states.std(dim=0, correction=0)

    def displace(self, transitions: Transitions, share: float, generator: torch.Generator) -> Transitions:
        """The same with a `share` of the next states, drawn at random, anywhere.

        Action and log-probability stay what they were, so that D's logit meets displaced states at the same
        level of log pi as those that were visited.
        """
        strategies, available = transitions.packed.shape[:2]
        count = round(share * available)
        if count == 0:
            return transitions
        chosen = torch.randperm(available, generator=generator)[:count]
        states = self._draw((strategies, count), generator)
        start = transitions.observation_width + transitions.action_width
        packed = transitions.packed.clone()
        packed[:, chosen, start : start + transitions.observation_width] = states
        return Transitions(packed, transitions.observation_width, transitions.action_width)

    def _draw(self, shape: tuple[int, int], generator: torch.Generator) -> Tensor:
        """Displaced states ``[*shape, O]``."""
        centre = self._states[torch.randint(len(self._states), shape, generator=generator)]
        exponent = torch.rand(centre.shape, generator=generator)
        size = self._deviation * torch.exp(math.log(LEAST) + (math.log(MOST) - math.log(LEAST)) * exponent)
        return centre + size * torch.randn(centre.shape, generator=generator)
