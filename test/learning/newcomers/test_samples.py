"""Trajectories as transitions of a newcomer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.config import DiscriminatorConfig
from msrd_ros.learning.newcomers.samples import samples_of, whole
from newcomer_problems import learned, to


def test_actions_and_densities_are_in_the_units_of_the_rewards() -> None:
    seen, done = to(0.5)
    config = replace(DiscriminatorConfig(), centre_log_prob=False, log_prob_bounds=(-1000.0, 1000.0))
    policy = learned().policy("to +0.0")
    plain = samples_of(seen[None], done[None], config, policy=policy)
    scaled = samples_of(seen[None], done[None], config, ActionScale(np.zeros(1), np.array([2.0])), policy)
    acting = slice(0, len(done))
    assert np.allclose(2.0 * scaled.action[0, acting], plain.action[0, acting])
    assert np.allclose(scaled.log_prob[0, acting], plain.log_prob[0, acting] + np.log(2.0), atol=1e-4)
    # Behind the last action nobody acts.
    assert plain.passive[0].tolist() == [0.0] * len(done) + [1.0] * (len(seen) - 1 - len(done))
    assert not samples_of(seen[None], done[None], config).log_prob.any()


def test_short_trajectories_stay_at_their_end() -> None:
    table = whole([np.arange(3.0)[:, None], np.arange(5.0)[:, None]])
    assert table[..., 0].tolist() == [[0.0, 1.0, 2.0, 2.0, 2.0], [0.0, 1.0, 2.0, 3.0, 4.0]]
    assert table.dtype == np.float64
