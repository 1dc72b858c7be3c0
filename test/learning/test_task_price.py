"""The price on R0: it keeps R0 small where nothing speaks for more, whichever network plays its part."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from learning_problems import PointMass, point_demonstrations
from msrd_ros.learning.config import DiscriminatorConfig, MSRDConfig
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods import find_method
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.studies.hopper.presets import hopper

BASE = MSRDConfig(iterations=3, discriminator=DiscriminatorConfig(steps=60, batch=32, learning_rate=1e-2))


def size(method: str, price: float) -> float:
    """Root mean square of the shared reward (of R_i where nothing is shared) after three iterations."""
    config = replace(BASE, discriminator=replace(BASE.discriminator, task_penalty_weight=price))
    data = point_demonstrations()
    trainer = find_method(method).start(Problem(config, data, BatchedCollector(PointMass()), 0))
    for _ in range(3):
        trainer.iterate()
    assert isinstance(trainer, MSRD)
    strategies = trainer.rewards.strategies
    states = torch.as_tensor(data.observations[:1], dtype=torch.float32).expand(strategies, -1, -1, -1)
    actions = torch.as_tensor(data.actions[:1], dtype=torch.float32).expand(strategies, -1, -1, -1)
    values = trainer.rewards(Transitions.of(states, actions))
    chosen = (values.combined if method == "airl_each_cross" else values.task).detach()
    return float(chosen.square().mean().sqrt())


@pytest.mark.parametrize("method", ["msrd", "airl", "airl_each_cross"])
def test_a_price_makes_it_smaller(method: str) -> None:
    free, cheap, dear = (size(method, price) for price in (0.0, 0.3, 30.0))
    assert dear < 0.2 * free
    assert dear < cheap < free


def test_the_paper_has_none() -> None:
    config = hopper(("x",), (1.0,), ("x",))
    assert config.discriminator.task_penalty_weight > 0.0
    assert as_printed(config).discriminator.task_penalty_weight == 0.0
    assert MSRDConfig().discriminator.task_penalty_weight == 0.0
