"""Gymnasium environments as places to play: parity with stepping them by hand, ends, rewards, restarts."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from gym_problems import NAMES, STEPS, Track
from msrd_ros.core.errors import UserError
from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.environment import GymCollector, GymEnvironment
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies


def pushers(std: float = 1.0, strategies: int = 2) -> GaussianPolicies:
    """Untrained policies of the track."""
    features = Features((0, 1), (0.0, 0.0), (1.0, 1.0))
    return GaussianPolicies(
        strategies, features, 1, (4,), float(np.log(std)), -3.0, 3.0, torch.Generator().manual_seed(0)
    )


def test_every_episode_is_as_if_it_were_played_alone() -> None:
    environment = GymEnvironment(Track, STEPS + 2)
    played = GymCollector(environment).collect(pushers(4.0), 5, np.random.default_rng(0))
    assert played.acting is not None
    assert played.lengths is not None
    assert played.environment_reward is not None
    ended = played.acting < played.lengths
    assert 0 < ended.sum() < ended.size
    rng = np.random.default_rng(0)
    rng.standard_normal((2, 5, STEPS + 2, 1), dtype=np.float32)
    for place in np.ndindex(2, 5):
        track = Track()
        seen, _ = track.reset(seed=int(rng.integers(2**31)))
        steps = int(played.acting[place])
        for step in range(steps):
            assert np.array_equal(played.observations[place][step], seen)
            seen, reward, over, cut, _ = track.step(played.actions[place][step])
            assert played.environment_reward[place][step] == pytest.approx(reward)
        assert over or cut
        assert over == ended[place]
        assert (played.observations[place][steps:] == seen).all()
        assert not played.actions[place][steps:].any()
        assert not played.environment_reward[place][steps:].any()


def test_what_an_environment_truncates_is_cut_there() -> None:
    environment = GymEnvironment(Track, horizon=STEPS + 5)
    played = GymCollector(environment).collect(pushers(0.1), 3, np.random.default_rng(0))
    assert np.all(played.acting == STEPS)
    assert np.all(played.lengths == STEPS)


def test_autoreset_starts_again_where_an_episode_ended() -> None:
    environment = GymEnvironment(lambda: Track(), horizon=STEPS - 1, autoreset=True)
    played = GymCollector(environment).collect(pushers(6.0), 8, np.random.default_rng(1))
    assert np.all(played.acting == STEPS - 1)
    off = np.abs(played.observations[:, :, :-1, 0]) > 2.0
    assert off.any()
    assert (np.abs(played.observations[:, :, 1:, 0][off]) < 2.0).all()


def test_actions_in_units_of_their_range() -> None:
    scale = ActionScale.of(np.array([-2.0]), np.array([4.0]), np.zeros((1, 1)))
    assert scale.from_unit(np.array([[-1.0], [0.0], [1.0]])).ravel().tolist() == [-2.0, 1.0, 4.0]
    assert scale.to_unit(scale.from_unit(np.array([0.3])))[0] == pytest.approx(0.3)
    free = ActionScale.of(np.array([-np.inf]), np.array([np.inf]), np.array([[3.0], [-5.0]]))
    assert free.from_unit(np.array([1.0]))[0] == 5.0
    plain = GymEnvironment(lambda: Track(10.0), STEPS)
    scaled = GymEnvironment(lambda: Track(10.0), STEPS, scale=ActionScale(np.zeros(1), np.full(1, 10.0)))
    for environment in (plain, scaled):
        environment.reset(1, 1, np.random.default_rng(0))
    assert np.array_equal(plain.step(np.full((1, 1, 1), 5.0)), scaled.step(np.full((1, 1, 1), 0.5)))


def test_an_environment_by_its_id_and_by_itself() -> None:
    by_id = GymEnvironment("Pendulum-v1")
    by_itself = GymEnvironment(gymnasium.make("Pendulum-v1"))
    assert by_id.horizon == by_itself.horizon == 200
    first, second = (environment.reset(1, 3, np.random.default_rng(0)) for environment in (by_id, by_itself))
    assert np.array_equal(first, second)


@pytest.mark.parametrize(
    ("arguments", "blame"),
    [
        ({"make": "NoSuchThing-v0"}, "environment 'NoSuchThing-v0'"),
        ({"make": "CartPole-v1"}, "are no Box"),
        ({"make": Track}, "has no time limit"),
        ({"make": Track(), "horizon": 5}, "cannot be copied"),
        ({"make": "Pendulum-v1", "observation_names": NAMES}, "2 observation names for 3 columns"),
    ],
)
def test_what_cannot_be_played_is_refused(arguments: dict[str, Any], blame: str) -> None:
    if arguments["make"] is Track:
        arguments = {"make": lambda: Track()}
    with pytest.raises(UserError, match=blame):
        GymEnvironment(**arguments)
