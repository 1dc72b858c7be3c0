"""Weighted means of policies, as a collector plays them."""

from __future__ import annotations

import numpy as np
import pytest

from learning_problems import PointMass
from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.rollouts import BatchedCollector
from newcomer_problems import learned


def test_it_is_the_weighted_mean_and_is_played() -> None:
    first, second = (learned().policy(name) for name in ("to -1.0", "to +1.0"))
    mixed = MixedPolicy([(0.25, first), (0.75, second)])
    states = np.random.default_rng(0).normal(size=(1, 5, 2))
    expected = 0.25 * first.act(states) + 0.75 * second.act(states)
    assert np.allclose(mixed.act(states), expected, atol=1e-6)
    assert np.allclose(mixed.act(states, np.ones((1, 5, 1))), expected, atol=1e-6)
    played = BatchedCollector(PointMass()).collect(mixed, 3, np.random.default_rng(1))  # type: ignore[arg-type]
    assert played.observations.shape == (1, 3, 31, 2)


def test_noise_density_and_scale() -> None:
    policy = learned().policy("to +0.0")
    alone = MixedPolicy([(1.0, policy)], noise=2.0, scale=ActionScale(np.array([1.0]), np.array([4.0])))
    states, noise = np.zeros((1, 1, 2)), np.full((1, 1, 1), 0.5)
    mean, deviation = float(policy.act(states)[0, 0, 0]), float(np.exp(policy.log_std[0]))
    assert alone.act(states, noise)[0, 0, 0] == pytest.approx((mean + deviation - 1.0) / 4.0, abs=1e-6)
    density = alone.log_prob(states, np.full((1, 1, 1), mean + deviation))
    assert density[0, 0] == pytest.approx(-0.5 - np.log(deviation) - 0.5 * np.log(2 * np.pi), abs=1e-5)


def test_it_is_not_trained() -> None:
    with pytest.raises(AttributeError, match="played, not trained"):
        _ = MixedPolicy([(1.0, learned().policy("to +0.0"))]).kl
