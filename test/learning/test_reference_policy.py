"""What it costs to leave the policies that cloning left."""

from __future__ import annotations

import copy
from dataclasses import replace

import pytest
import torch

from learning_problems import PointMass, point_demonstrations
from msrd_ros.learning.config import DiscriminatorConfig, MSRDConfig, PolicyConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.reference_policy import ReferencePolicy
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Transitions

CONFIG = MSRDConfig(
    iterations=20, episodes=20, discriminator=DiscriminatorConfig(steps=3, batch=64, cross_batch=16)
)


def training(price: float) -> MSRD:
    config = replace(CONFIG, policy=PolicyConfig(reference_price=price))
    return MSRD(config, point_demonstrations(), BatchedCollector(PointMass()), 0)


def gaussian(trainer: MSRD) -> GaussianPolicies:
    assert isinstance(trainer.policies, GaussianPolicies)
    return trainer.policies


def steps_of(trainer: MSRD, count: int) -> Transitions:
    """Demonstrated states with actions that the present policies draw there."""
    pool = DemonstrationPool(point_demonstrations())
    generator = torch.Generator().manual_seed(3)
    steps = pool.sample(pool.choose(None, generator), count, generator)
    with torch.no_grad():
        mean, log_std = gaussian(trainer).distribution(steps.observation)
        drawn = mean + log_std.exp() * torch.randn(mean.shape, generator=generator)
    width = steps.observation.shape[-1]
    packed = steps.packed.clone()
    packed[..., width : width + drawn.shape[-1]] = drawn
    return Transitions(packed, width, drawn.shape[-1])


def test_a_cost_is_the_divergence_times_its_price_and_nothing_where_nobody_acts() -> None:
    trainer = training(0.0)
    reference = ReferencePolicy(trainer.policies, 0.5)
    steps = steps_of(trainer, 20000)
    assert reference.cost(steps, trainer.policies).abs().max() == 0.0
    with torch.no_grad():
        gaussian(trainer).log_std.add_(0.3)
    steps = steps_of(trainer, 20000)
    acting = 1.0 - steps.passive
    cost = reference.cost(steps, trainer.policies)
    assert cost[steps.passive.bool()].abs().sum() == 0.0
    actions = steps.action.shape[-1]
    expected = 0.5 * actions * (0.5 * (torch.tensor(0.6).exp() - 1.0) - 0.3)
    assert float(cost.sum() / acting.sum()) == pytest.approx(float(expected), rel=0.1)


def test_a_price_keeps_policies_near_the_clone_and_a_resumed_run_knows_it() -> None:
    strayed = {}
    for price in (0.0, 1.0, 100.0):
        trainer = training(price)
        trainer.clone()
        clone = ReferencePolicy(trainer.policies, 1.0)
        for _ in range(10):
            trainer.iterate()
        strayed[price] = float(clone.cost(steps_of(trainer, 5000), trainer.policies).mean())
        resumed = training(price)
        resumed.load_state_dict(copy.deepcopy(trainer.state_dict()))
        assert resumed.iterate()["reward"] == trainer.iterate()["reward"]
    assert strayed[100.0] < 0.5 * strayed[1.0]
    assert strayed[1.0] < strayed[0.0]
