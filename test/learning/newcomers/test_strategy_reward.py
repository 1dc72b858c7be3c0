"""Reward models that grow and shrink by a strategy."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import DiscriminatorConfig
from msrd_ros.learning.networks import Features
from msrd_ros.learning.newcomers.strategy_reward import (
    learn_strategy_reward,
    without_strategy,
)
from msrd_ros.learning.rewards import RewardForm, RewardModel
from msrd_ros.learning.trajectories import Transitions

FEATURES = Features((0, 1), (0.0, 0.0), (1.0, 1.0))


def model(form: RewardForm = RewardForm.TWO_COLUMN, groups: tuple[int, ...] = ()) -> RewardModel:
    generator = torch.Generator().manual_seed(0)
    return RewardModel(
        form, 3, FEATURES, FEATURES, 0, (8, 8), (0.5, 1.0, 2.0), generator, reward_groups=groups
    )


def at(place: float, count: int = 400) -> Transitions:
    generator = torch.Generator().manual_seed(1)
    packed = torch.zeros(1, count, 2 + 1 + 2 + 2)
    packed[..., 3:5] = place + 0.2 * torch.randn(1, count, 2, generator=generator)
    return Transitions(packed, 2, 1)


def test_the_newcomers_reward_is_highest_where_it_goes_and_others_stay() -> None:
    rewards = model()
    config = replace(DiscriminatorConfig(), batch=64)
    grown = learn_strategy_reward(
        rewards, at(1.0), at(1.2), at(-1.0), config, torch.Generator().manual_seed(2)
    )
    assert grown.strategies == 4
    assert torch.equal(grown.task_network.flat(), rewards.task_network.flat())
    assert torch.equal(grown.strategy_network.flat()[:3], rewards.strategy_network.flat())
    assert torch.equal(grown.alpha[:3], rewards.alpha)
    places = [Transitions(at(place).packed.expand(4, -1, -1), 2, 1) for place in (1.0, -1.0)]
    own, other = (float(grown(place).strategy[3].mean()) for place in places)
    assert own > other
    assert torch.equal(
        without_strategy(grown, 3, torch.Generator()).strategy_network.flat(), rewards.strategy_network.flat()
    )


def test_shared_rewards_stay_shared() -> None:
    config = replace(DiscriminatorConfig(), batch=16)
    rewards = model(groups=(0, 1, 0))
    grown = learn_strategy_reward(rewards, at(1.0), at(1.0), at(-1.0), config, torch.Generator())
    assert grown.reward_groups is not None
    assert grown.reward_groups.tolist() == [0, 1, 0, 2]
    fewer = without_strategy(grown, 1, torch.Generator())
    assert fewer.reward_groups is not None
    assert fewer.reward_groups.tolist() == [0, 0, 1]
    assert torch.equal(fewer.strategy_network.flat()[1], grown.strategy_network.flat()[2])


def test_rewards_without_two_columns_are_refused() -> None:
    with pytest.raises(UserError, match="need R0 and S_i"):
        learn_strategy_reward(
            model(RewardForm.STRATEGY_ONLY),
            at(1.0),
            at(1.0),
            at(0.0),
            DiscriminatorConfig(),
            torch.Generator(),
        )
