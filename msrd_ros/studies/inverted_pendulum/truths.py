"""What the demonstrators really prefer: the strategy reward each of them was trained on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts

OBSERVATION_SCALES = (0.5, 0.3, 1.0, 2.0)


def pendulum_features() -> Features:
    """All four columns at a fixed scale: metres, radians and their rates at the size they move."""
    return Features((0, 1, 2, 3), (0.0,) * 4, OBSERVATION_SCALES)


def extrinsic(states: Tensor) -> Tensor:
    """True task reward of states ``[..., 4]``: minus the pole's absolute angle."""
    return -states[..., 1].abs()


@dataclass(frozen=True)
class KnownPreferences:
    """Preferences written down beforehand: the only truth that no network had a hand in.

    Strategy i likes one column of the state, or its absolute value, near a target, and its cart not too far
    from the middle: ``S_i(s) = -min(((s[column] - target) / width)^2 + (s[0] / roam)^2, bound)``.

    Attributes
    ----------
    columns, targets, widths
        One per strategy.
    absolute
        Whether the column's absolute value is meant (a speed rather than a velocity).
    roam
        How far the cart may go, in metres; infinite for those who like a place of their own.
    bound
        Where dislike stops growing.
    """

    columns: tuple[int, ...]
    targets: tuple[float, ...]
    widths: tuple[float, ...]
    absolute: tuple[bool, ...]
    roam: tuple[float, ...]
    bound: float = 4.0

    def values(self, states: Tensor) -> Tensor:
        """Row i of ``states [S, ..., 4]`` judged by strategy i, ``[S, ...]``."""
        rows = []
        for index, column in enumerate(self.columns):
            value = states[index, ..., column]
            value = value.abs() if self.absolute[index] else value
            dislike = ((value - self.targets[index]) / self.widths[index]).square()
            dislike = dislike + (states[index, ..., 0] / self.roam[index]).square()
            rows.append(-dislike.clamp(max=self.bound))
        return torch.stack(rows)

    def table(self, states: Tensor) -> Tensor:
        """``[S, N]``."""
        return self.values(states.unsqueeze(0).expand(len(self.columns), -1, -1))

    def subset(self, kept: tuple[int, ...]) -> KnownPreferences:
        """Those of the strategies `kept`."""
        return KnownPreferences(
            tuple(self.columns[index] for index in kept),
            tuple(self.targets[index] for index in kept),
            tuple(self.widths[index] for index in kept),
            tuple(self.absolute[index] for index in kept),
            tuple(self.roam[index] for index in kept),
            self.bound,
        )

    @classmethod
    def twenty(cls) -> KnownPreferences:
        """12 cart positions, 4 sways (cart speeds, none too fast for the rail), 4 leans of the pole."""
        positions = tuple(np.linspace(-0.66, 0.66, 12).round(3).tolist())
        sways, leans = (0.1, 0.2, 0.3, 0.4), (-0.03, -0.015, 0.015, 0.03)
        return cls(
            (0,) * 12 + (2,) * 4 + (1,) * 4,
            positions + sways + leans,
            (0.4,) * 12 + (0.15,) * 4 + (0.03,) * 4,
            (False,) * 12 + (True,) * 4 + (False,) * 4,
            (math.inf,) * 12 + (0.4,) * 8,
        )


class PreferenceReward:
    """``R0(s') + weight * S_i(s')`` with a known S_i: the demonstrators of the exact truth.

    Parameters
    ----------
    preferences
        S_1..S_N.
    weight
        Weight alpha of the preference.
    """

    def __init__(self, preferences: KnownPreferences, weight: float) -> None:
        self._preferences = preferences
        self._weight = weight

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Reward of every transition, ``[S, K, T]``."""
        states = torch.as_tensor(rollouts.observations[:, :, 1:])
        return extrinsic(states) + self._weight * self._preferences.values(states)
