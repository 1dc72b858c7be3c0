"""Displaced negatives: where they lie, and what of a transition they leave as it is."""

from __future__ import annotations

import numpy as np
import torch

from learning_problems import point_demonstrations
from msrd_ros.learning.displaced import MOST, Displacement
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.trajectories import Transitions


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def visited(pool: DemonstrationPool, count: int) -> Transitions:
    return pool.sample(pool.choose(None, generator()), count, generator(1))


def test_moves_the_share_asked_for_and_nothing_but_the_next_state() -> None:
    pool = DemonstrationPool(point_demonstrations())
    before = visited(pool, 200)
    after = Displacement(pool).displace(before, 0.25, generator(2))
    moved = (after.next_observation != before.next_observation).all(dim=-1)
    assert moved.sum(dim=1).tolist() == [50] * len(moved)
    assert torch.equal(after.observation, before.observation)
    assert torch.equal(after.action, before.action)
    assert torch.equal(after.log_prob, before.log_prob)
    assert torch.equal(after.passive, before.passive)


def test_a_share_of_nothing_draws_nothing() -> None:
    pool = DemonstrationPool(point_demonstrations())
    before, source = visited(pool, 20), generator(3)
    assert Displacement(pool).displace(before, 0.0, source) is before
    assert torch.equal(torch.rand(1, generator=source), torch.rand(1, generator=generator(3)))


def test_offsets_go_from_hardly_any_to_far_away_in_each_column_on_its_own() -> None:
    pool = DemonstrationPool(point_demonstrations())
    states = pool.states()
    displaced = Displacement(pool).displace(visited(pool, 4000), 1.0, generator(4)).next_observation
    away = ((displaced - states.mean(dim=0)) / states.std(dim=0)).abs().flatten(0, 1).numpy()
    assert (np.quantile(away, 0.5, axis=0) < 3.0).all()
    assert (np.quantile(away, 0.99, axis=0) > MOST).all()
    odd = away > 5.0
    assert (odd.any(axis=1) & ~odd.all(axis=1)).mean() > 0.1


def test_states_are_those_that_demonstrations_lead_to() -> None:
    demonstrations = point_demonstrations()
    states = DemonstrationPool(demonstrations).states()
    assert len(states) == demonstrations.step_counts().sum()
    last = demonstrations.observations[0, 0, demonstrations.step_counts()[0, 0]]
    assert any(np.allclose(last, row) for row in states.numpy())
