"""Columns that are not observed but follow from a transition, such as how a tool moves.

A policy that is to be played sees what the robot's topics say. Rewards are asked about transitions that are
over, so they may see what follows from two observations: of a body that other robots have as well, which
makes a reward one of the task and not of the robot that was taught.
"""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.networks import Features
from msrd_ros.learning.trajectories import Transitions


class DerivedColumns(Protocol):
    """A function of transitions that gives further columns, which stand behind those of the observation."""

    @property
    def names(self) -> tuple[str, ...]:
        """One name per column, D of them."""
        ...

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        """Of the observations that transitions start from and lead to, ``[..., O]`` each: ``[..., D]``."""
        ...


def features_of(features: Features, transitions: Transitions, derived: DerivedColumns | None) -> Tensor:
    """Features ``[S, N, W]`` of the states that transitions lead to.

    Raises
    ------
    UserError
        If they are of derived columns and nobody says how these follow.
    """
    state = transitions.next_observation
    if features.highest >= state.shape[-1]:
        if derived is None:
            raise UserError(
                "rewards: see columns that follow from a transition, and nothing here derives them; "
                "tell the rewards how: RewardModel.on"
            )
        state = torch.cat([state, derived(transitions.observation, state)], dim=-1)
    return features(state)
