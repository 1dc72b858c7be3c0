"""How far a reward of states can go at all: one that is taught the true returns of another test set.

The mean of any R0 over a trajectory's states cannot tell a wreck that stands still and upright on both legs
from a lander that came down well; the truth pays the one -100 a step and the other +100.
"""

from __future__ import annotations

import torch
from torch.nn.functional import mse_loss

from msrd_ros.learning.examples.lunar_lander import SCALES
from msrd_ros.learning.networks import BatchedMLP
from msrd_ros.studies.lunar_lander.test_sets import TestSet
from msrd_ros.studies.shared.estimates import Rewards

HIDDEN = (64, 64)
TRAJECTORIES, STATES = 128, 40
"""Of a batch, and of each of its trajectories."""
FAR = 5.0
"""Inputs are cut off here, in `SCALES`: lost landers fall without end."""


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
