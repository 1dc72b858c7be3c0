"""Training in one call, and what it refuses or warns of."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gym_problems import NAMES, Track, quick, short, track_arrays, track_demonstrations
from learning_problems import PointMass, point_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import FeatureConfig
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.environment import GymEnvironment
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.methods import METHODS
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.training import train


def distance(learned: Learned, name: str, strength: float = 1.0) -> float:
    """Where the policy's cart ends."""
    track = Track(strength)
    seen, _ = track.reset(seed=5)
    for _ in range(30):
        seen, *_ = track.step(learned.policy(name).act(seen))
    return float(seen[0])


@pytest.mark.parametrize("name", METHODS)
def test_every_method_trains_in_a_gymnasium_environment(name: str) -> None:
    learned = quick(method=name)
    assert learned.labels == ("left", "right")
    assert learned.details["method"] == name
    assert (learned.rewards is None) == (name == "cloning")
    states = np.zeros((3, 2))
    assert learned.policy("right").act(states).shape == (3, 1)


def test_policies_do_what_they_were_shown_and_rewards_tell_them_apart() -> None:
    learned = quick(config=short(iterations=15, cloning_steps=400))
    for name, place in (("left", -1.0), ("right", 1.0)):
        assert distance(learned, name) == pytest.approx(place, abs=0.3)
        own, other = learned.strategy_reward(name, [[place, 0.0], [-place, 0.0]])
        assert own > other


def test_the_environments_own_reward_is_recorded() -> None:
    curve = quick(config=short(iterations=3)).details["curve"]
    assert len(curve) == 3
    assert all(0.0 < value <= 30.0 for returns in curve for value in returns)


def test_a_seed_gives_the_same_result_again() -> None:
    first, again, other = (quick(seed=seed) for seed in (1, 1, 2))
    states = np.random.default_rng(0).normal(size=(5, 2))
    assert np.array_equal(first.task_reward(states), again.task_reward(states))
    assert np.array_equal(first.policy("left").act(states), again.policy("left").act(states))
    assert not np.array_equal(first.task_reward(states), other.task_reward(states))


def test_actions_are_learned_in_the_environments_own_units() -> None:
    demonstrations = track_demonstrations(strength=50.0)
    learned = quick(
        demonstrations=demonstrations,
        environment=lambda: Track(50.0),
        method="cloning",
        config=short(cloning_steps=400),
    )
    assert distance(learned, "right", 50.0) == pytest.approx(1.0, abs=0.3)
    assert np.exp(learned.policy("right").log_std)[0] == pytest.approx(50.0 * default_config().policy.std)


def test_recovery_labels_have_gains_in_the_environments_units() -> None:
    cloning = replace(short().cloning, recovery_labels=(("position", "push", 100.0),))
    learned = quick(
        demonstrations=track_demonstrations(strength=50.0),
        environment=lambda: Track(50.0),
        method="cloning",
        config=replace(short(), cloning=cloning),
    )
    assert learned.details["config"]["cloning"]["recovery_labels"] == (("position", "push", 2.0),)


def test_an_environment_of_ones_own_needs_no_gymnasium() -> None:
    config = default_config(restarts=False)
    config = replace(config, iterations=1, cloning=replace(config.cloning, steps=10))
    learned = train(point_demonstrations(), PointMass(), config=config, progress=False)
    assert learned.details["curve"] == []
    assert len(learned.labels) == 3


@pytest.mark.parametrize(
    ("arguments", "blame"),
    [
        ({"labels": "guess"}, "labels='guess': there are 'given' and 'discover'"),
        ({"method": "gail"}, "method 'gail' is unknown"),
        ({"environment": 3}, "environment: int is none"),
        ({"environment": "Pendulum-v1"}, "environment: 3 observation columns"),
        (
            {"environment": GymEnvironment(Track, 30, observation_names=NAMES[::-1])},
            "environment: does not fit: observations: same columns in another order",
        ),
        (
            {"environment": GymEnvironment(Track, 30, action_names=("force",))},
            "actions: lacks push and has force too many",
        ),
        ({"environment": lambda: Track(breaks_at=4)}, "step 4: observation 'speed' is nan after observation"),
        (
            {"config": replace(short(), policy=replace(short().policy, features=FeatureConfig(("angle",))))},
            "no observation column 'angle'; there are position, speed",
        ),
        (
            {"config": replace(short(), reward=replace(short().reward, alpha=(1.0, 2.0, 3.0)))},
            "reward.alpha: 3 values for 2 strategies",
        ),
        (
            {"config": replace(short(), cloning=CloningConfig(state_noise=(("angle", 0.1),)))},
            "cloning: no column 'angle'",
        ),
        (
            {"config": replace(short(), cloning=replace(short().cloning, learning_rate=1e30))},
            "diverged",
        ),
    ],
)
def test_misuse_is_named(arguments: dict[str, Any], blame: str) -> None:
    with pytest.raises(UserError, match=re.escape(blame)):
        quick(**arguments)


def test_a_wrong_number_of_scales_is_named() -> None:
    with pytest.raises(UserError, match="features: 1 scales for 2 columns; give one each"):
        FeatureConfig(NAMES, (1.0,))
    features = FeatureConfig(scales=(1.0, 1.0, 1.0))
    with pytest.raises(UserError, match="features: 3 scales for 2 columns; give one each"):
        quick(config=replace(short(), policy=replace(short().policy, features=features)))


def test_restarts_need_an_environment_that_starts_again() -> None:
    config = replace(short(), cloning=CloningConfig(steps=1, restarts=(1.0,)))
    with pytest.raises(UserError, match=r"cloning\.restarts: only Gymnasium environments"):
        train(point_demonstrations(), PointMass(), config=config, progress=False)


def test_columns_in_another_order_are_warned_of() -> None:
    seen, done, labels = track_arrays({"left": -1.0, "right": 1.0})
    moved = [states + np.array([30.0, 0.0]) for states in seen]
    demonstrations = demonstrations_from_arrays(moved, done, labels)
    with pytest.warns(UserWarning, match=r"'observation_0' begins at 30.* in another order or unit"):
        quick(demonstrations=demonstrations, method="cloning")


def test_actions_beyond_the_bounds_are_warned_of() -> None:
    demonstrations = track_demonstrations(strength=50.0)
    with pytest.warns(UserWarning, match=r"'push' reaches -?50 .* clips it to -1 .. 1"):
        quick(demonstrations=demonstrations, method="cloning")


def test_good_data_give_no_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        quick(method="cloning")


def test_labels_are_discovered_and_learning_agrees() -> None:
    seen, done, labels = track_arrays({"left": -1.0, "right": 1.0})
    hidden = demonstrations_from_arrays(seen, done, None, observation_names=NAMES, action_names=("push",))
    with pytest.raises(
        UserError, match="some have no label; label every one, or train with labels='discover'"
    ):
        quick(demonstrations=hidden, method="cloning")
    learned = quick(demonstrations=hidden, labels="discover", config=short(iterations=5, cloning_steps=400))
    found = learned.details["discovery"]
    groups = {frozenset(labels[entry["index"]] for entry in group) for group in found["strategies"].values()}
    assert groups == {frozenset({"left"}), frozenset({"right"})}
    assert learned.labels == ("strategy-1", "strategy-2")
    assert found["recheck"]["moved"] == []
