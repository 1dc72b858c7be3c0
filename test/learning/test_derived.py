"""Columns that follow from a transition: seen by rewards, by their names, also of other observations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from gym_problems import Track, short, track_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import FeatureConfig, MSRDConfig
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods.frozen_reward import EnvironmentReward, FrozenReward
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.places import find_place
from msrd_ros.learning.training import train
from msrd_ros.learning.trajectories import Demonstrations, Transitions

POSITION = 0


@dataclass(frozen=True)
class Moved:
    """How far the first column went."""

    names: tuple[str, ...] = ("moved",)

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        return (after - before)[..., POSITION : POSITION + 1]


def shown() -> Demonstrations:
    return replace(track_demonstrations(), derived=Moved())


def config() -> MSRDConfig:
    plain = short()
    seen = (shown().layout.observation_names[0], "moved")
    return replace(
        plain,
        reward=replace(plain.reward, strategy_features=FeatureConfig(names=seen), nearness=0.0),
        replay=replace(plain.replay, displaced_share=0.0),
    )


@pytest.fixture(scope="module")
def learned() -> Learned:
    return train(shown(), Track, config=config(), progress=False)


def test_only_rewards_see_them(learned: Learned) -> None:
    assert learned.rewards is not None
    width = len(learned.layout.observation_names)
    assert learned.rewards.strategy_features.indices.tolist() == [0, width]
    assert learned.rewards.columns == (*learned.layout.observation_names, "moved")
    assert learned.policies.tensors["indices"].tolist() == list(range(width))
    demonstrations = shown()
    steps = np.diff(demonstrations.observations[..., POSITION], axis=2)
    # The first state counts as not having moved.
    every = np.concatenate([np.zeros((*steps.shape[:2], 1)), steps], axis=2)
    features = config().reward.strategy_features.build(demonstrations, Moved())
    assert float(features.offset[1]) == pytest.approx(every.mean(), abs=1e-5)
    assert float(features.scale[1]) == pytest.approx(every.std(), rel=1e-3)


def test_rewards_of_them_are_asked_with_the_state_before(learned: Learned) -> None:
    states = np.random.default_rng(0).normal(size=(5, 2))
    with pytest.raises(UserError, match="what follows from two states; pass before="):
        learned.strategy_reward("left", states)
    still, moving = (learned.strategy_reward("left", states, before=states - each) for each in (0.0, 1.0))
    assert not np.allclose(still, moving)
    # R0 sees observed columns alone.
    assert np.array_equal(learned.task_reward(states), learned.task_reward(states, before=states - 1.0))


def test_a_file_says_what_was_seen_and_not_how_it_follows(learned: Learned, tmp_path: Path) -> None:
    learned.save(tmp_path / "l.safetensors")
    found = Learned.load(tmp_path / "l.safetensors")
    assert found.rewards is not None
    states = np.random.default_rng(0).normal(size=(5, 2))
    with pytest.raises(UserError, match="nothing here derives them"):
        found.strategy_reward("left", states, before=states)
    again = replace(found, rewards=found.rewards.on(found.layout.observation_names, Moved()))
    expected = learned.strategy_reward("left", states, before=states - 0.5)
    assert np.array_equal(again.strategy_reward("left", states, before=states - 0.5), expected)


def test_rewards_go_to_other_observations_by_the_names_of_columns(learned: Learned) -> None:
    assert learned.rewards is not None
    names = learned.layout.observation_names
    other = ("another", *names[::-1])
    moved = learned.rewards.on(other, _Behind())
    start, end = torch.randn(2, 1, 7, 2).unbind()
    here = torch.cat([start, torch.zeros(1, 7, 1), end, torch.zeros(1, 7, 2)], dim=-1)
    there = torch.cat(
        [torch.ones(1, 7, 1), start.flip(-1), torch.zeros(1, 7, 1), torch.ones(1, 7, 1), end.flip(-1),
         torch.zeros(1, 7, 2)], dim=-1,
    )  # fmt: skip
    rows = learned.rewards.strategies
    found = moved(Transitions(there.expand(rows, -1, -1), 3, 1))
    expected = learned.rewards(Transitions(here.expand(rows, -1, -1), 2, 1))
    torch.testing.assert_close(found.combined, expected.combined)
    with pytest.raises(UserError, match=f"rewards: see {', '.join(names)}; there are another"):
        learned.rewards.on(("another",), Moved())


@dataclass(frozen=True)
class _Behind(Moved):
    """The same of observations in another order, whose last column is the first of before."""

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        return (after - before)[..., -1:]


def test_what_cannot_be_derived_is_refused() -> None:
    settings = config()
    displaced = replace(settings, replay=replace(settings.replay, displaced_share=0.5))
    with pytest.raises(UserError, match="of a displaced state no column can be derived"):
        train(shown(), Track, config=displaced, progress=False)
    with pytest.raises(UserError, match="no observation column 'moved'"):
        train(track_demonstrations(), Track, config=settings, progress=False)


def problem(**changes: object) -> Problem:
    settings = replace(config(), **changes)  # type: ignore[arg-type]
    return Problem(settings, shown(), find_place(Track, shown()).collector, 3)


def test_frozen_rewards_stay_as_they_are_and_their_run_resumes_exactly(learned: Learned) -> None:
    assert learned.rewards is not None
    method = FrozenReward(learned.rewards)
    runs = [method.start(problem()) for _ in range(2)]
    assert runs[0].config.policy.reference_price == 1.0
    runs[0].clone()
    for _ in range(2):
        figures = runs[0].iterate()
    assert figures["kl"] > 0.0
    for name, value in runs[0].averaged_rewards.state_dict().items():
        assert torch.equal(value, learned.rewards.state_dict()[name]), name
    half = method.start(problem())
    half.clone()
    half.iterate()
    runs[1].load_state_dict(half.state_dict())
    runs[1].iterate()
    assert isinstance(runs[0], MSRD)
    for name, value in runs[1].policies.state_dict().items():
        assert torch.equal(value, runs[0].policies.state_dict()[name]), name


def test_frozen_rewards_of_other_strategies_are_refused(learned: Learned) -> None:
    assert learned.rewards is not None
    one = shown().pooled()
    with pytest.raises(UserError, match=f"frozen rewards of {learned.rewards.strategies} strategies, for 1"):
        FrozenReward(learned.rewards).start(replace(problem(), demonstrations=one))


def test_the_environments_own_reward_is_optimised_where_it_pays_any() -> None:
    run = EnvironmentReward(price=0.0).start(problem())
    run.clone()
    assert np.isfinite(run.iterate()["reward"])
