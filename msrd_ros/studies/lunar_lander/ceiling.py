"""How far a reward of states can go at all: one that is taught the true returns of another test set.

The mean of any R0 over a trajectory's states cannot tell a wreck that stands still and upright on both legs
from a lander that came down well; the truth pays the one -100 a step and the other +100.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch.nn.functional import mse_loss

from msrd_ros.learning.examples.lunar_lander import OBSERVATION_NAMES, SCALES
from msrd_ros.learning.networks import BatchedMLP
from msrd_ros.studies.lunar_lander.evaluation import judge_task
from msrd_ros.studies.lunar_lander.test_sets import TestSet
from msrd_ros.studies.shared.estimates import Rewards

HIDDEN = (64, 64)
TRAJECTORIES, STATES = 128, 40
"""Of a batch, and of each of its trajectories."""
FAR = 5.0
"""Inputs are cut off here, in `SCALES`: lost landers fall without end."""

_LAST, _SLOW, _UPRIGHT_RAD = 100, 0.05, 0.15
"""Steps of the end that are looked at, and what counts as still and upright there."""


def ceilings(
    sets: Mapping[str, TestSet], steps: int, seeds: Mapping[str, int]
) -> dict[str, dict[str, float]]:
    """By set: marks (`judge_task`) of a reward that is taught the truth of the other one of two sets.

    Beside them ``taught_r``, r of that reward on the set that it was taught, and `standing_wrecks`.
    """
    found = {}
    for name, other in zip(sets, reversed(list(sets)), strict=True):
        reward = taught_reward(sets[other], steps, seeds[other])
        found[name] = judge_task(reward, sets[name]) | {
            "taught_r": judge_task(reward, sets[other])["task_r"],
            "standing_wrecks": standing_wrecks(sets[name]),
        }
    return found


def standing_wrecks(test: TestSet) -> float:
    """Share of the trajectories that crashed within the bounds which ends still, upright and on both legs."""
    end = test.observations[:, -_LAST:]
    column = OBSERVATION_NAMES.index
    crashed = test.lost & (np.abs(end[:, -1, column("x")]) <= 1.0)
    still = np.abs(end[..., [column("vx"), column("vy")]]).max(axis=2).mean(axis=1) < _SLOW
    mean = end.mean(axis=1)
    standing = (mean[:, column("left_leg")] > 0.9) & (mean[:, column("right_leg")] > 0.9)
    upright = np.abs(mean[:, column("angle")]) < _UPRIGHT_RAD
    return float((still & standing & upright)[crashed].mean()) if crashed.any() else 0.0


def taught_reward(known: TestSet, steps: int, seed: int) -> Rewards:
    """The reward whose mean over a trajectory's states fits the true returns of `known` by least squares."""
    generator = torch.Generator().manual_seed(seed)
    scale = torch.tensor(SCALES)
    network = BatchedMLP(1, (len(SCALES), *HIDDEN, 1), generator)

    def reward(states: torch.Tensor) -> torch.Tensor:
        inputs = (states / scale).clamp(-FAR, FAR)
        return network(inputs.reshape(1, -1, len(SCALES))).reshape(states.shape[:-1])

    states = torch.as_tensor(known.observations[:, 1:])
    truth = torch.as_tensor((known.truth - known.truth.mean()) / known.truth.std(), dtype=torch.float32)
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3, weight_decay=1e-4)
    for _ in range(steps):
        rows = torch.randint(len(states), (TRAJECTORIES, 1), generator=generator)
        columns = torch.randint(states.shape[1], (TRAJECTORIES, STATES), generator=generator)
        loss = mse_loss(reward(states[rows, columns]).mean(dim=1), truth[rows[:, 0]])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    network.requires_grad_(False)
    return reward
