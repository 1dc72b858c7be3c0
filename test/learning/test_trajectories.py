"""Demonstrations, transitions, pools and cloning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from learning_problems import PointMass, point_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig, clone, perturbation
from msrd_ros.learning.config import FeatureConfig
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.replay import DemonstrationPool, Replay
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations, Transitions


def counted(lengths: np.ndarray | None = None) -> Demonstrations:
    """Observation = (strategy, 100 * demonstration + step): every sample says where it is from."""
    strategy, demo, step = np.meshgrid(range(2), range(3), range(6), indexing="ij")
    observations = np.stack([strategy, 100 * demo + step], axis=-1).astype(float)
    layout = Layout(("strategy", "place"), ("a",), ("one", "two"), 0.1)
    return Demonstrations(observations, observations[:, :, :4, 1:], layout, lengths)


def test_transitions_pair_states_with_their_successors() -> None:
    data = counted()
    found = Transitions.of(torch.as_tensor(data.observations), torch.as_tensor(data.actions))
    assert found.packed.shape == (2, 15, 7)
    place = found.observation[..., 1]
    assert torch.equal(found.next_observation[..., 1], place + 1.0)
    passive = place % 100 >= 4
    assert torch.equal(found.passive, passive.float())
    assert torch.equal(found.action[..., 0], torch.where(passive, torch.zeros(()), place))


def test_sampling_keeps_to_valid_steps_of_chosen_demonstrations() -> None:
    pool = DemonstrationPool(counted(np.array([[5, 2, 0], [0, 1, 5]])))
    generator = torch.Generator().manual_seed(0)
    chosen = pool.choose(None, generator)
    sample = pool.sample(chosen, 500, generator).observation
    assert set(sample[0, :, 1].int().tolist()) == {0, 1, 2, 3, 4, 100, 101}
    assert set(sample[1, :, 1].int().tolist()) == {100, 200, 201, 202, 203, 204}
    assert sample[0, :, 0].eq(0).all()
    assert sample[1, :, 0].eq(1).all()


def test_choosing_k_demonstrations_repeats_none() -> None:
    pool = DemonstrationPool(counted())
    generator = torch.Generator().manual_seed(0)
    seen = set()
    for _ in range(40):
        chosen = pool.choose(2, generator)
        assert chosen.shape == (2, 2)
        assert (chosen[:, 0] != chosen[:, 1]).all()
        seen |= {tuple(row.tolist()) for row in chosen}
    assert len(seen) == 6


def test_pooling_keeps_every_trajectory() -> None:
    pooled = counted(np.array([[5, 2, 0], [0, 1, 5]])).pooled()
    assert pooled.observations.shape == (1, 6, 6, 2)
    assert pooled.layout.labels == ("all",)
    assert pooled.lengths is not None
    assert pooled.lengths.tolist() == [[5, 2, 0, 0, 1, 5]]


def test_bad_demonstrations_are_refused() -> None:
    good = counted()
    with pytest.raises(UserError, match="none for strategy 'two'"):
        counted(np.array([[5, 2, 0], [0, 0, 0]]))
    with pytest.raises(UserError, match="not a finite number"):
        Demonstrations(good.observations * np.nan, good.actions, good.layout)
    with pytest.raises(UserError, match="do not go with"):
        Demonstrations(good.observations[:1], good.actions, good.layout)
    with pytest.raises(UserError, match="1 observation names"):
        Demonstrations(good.observations, good.actions, replace(good.layout, observation_names=("x",)))


def test_replay_is_a_ring() -> None:
    replay = Replay(1, 6, 2, 1)
    generator = torch.Generator().manual_seed(0)
    for value in range(5):
        packed = torch.full((1, 4, 7), float(value))
        replay.add(Transitions(packed, 2, 1), 2, generator)
    found = replay.sample(300, generator).packed[..., 0]
    assert set(found.flatten().int().tolist()) == {2, 3, 4}
    other = Replay(1, 6, 2, 1)
    other.load_state_dict(replay.state_dict())
    assert torch.equal(other.transitions.packed, replay.transitions.packed)


def test_features_by_name_and_by_the_demonstrations_spread() -> None:
    data = point_demonstrations()
    features = FeatureConfig(names=("speed",)).build(data)
    scaled = features(torch.as_tensor(data.observations, dtype=torch.float32))
    assert abs(float(scaled.mean())) < 1e-4
    assert float(scaled.std()) == pytest.approx(1.0, abs=1e-2)
    with pytest.raises(UserError, match="no observation column 'height'"):
        FeatureConfig(names=("height",)).build(data)
    with pytest.raises(UserError, match="3 scales for 2 columns"):
        FeatureConfig(scales=(1.0, 1.0, 1.0)).build(data)


def test_collector_plays_noise_it_drew_beforehand_and_rests_after_the_acting_steps() -> None:
    features = FeatureConfig().build(point_demonstrations())
    policies = GaussianPolicies(3, features, 1, (8,), -1.0, -3.0, 0.0, torch.Generator().manual_seed(0))
    found = BatchedCollector(PointMass()).collect(policies, 2, np.random.default_rng(5))
    assert found.observations.shape == (3, 2, 31, 2)
    assert found.actions.shape == (3, 2, 20, 1)
    noise = np.random.default_rng(5).standard_normal((3, 2, 20, 1), dtype=np.float32)
    again = policies.act(found.observations[:, :, 7], noise[:, :, 7])
    np.testing.assert_allclose(again, found.actions[:, :, 7], atol=1e-6)
    speed = found.observations[..., 1]
    np.testing.assert_allclose(speed[:, :, 21:], 0.9 * speed[:, :, 20:-1], rtol=1e-5, atol=1e-7)


def test_cloning_recovers_the_demonstrated_actions() -> None:
    data = point_demonstrations()
    features = FeatureConfig().build(data)
    generator = torch.Generator().manual_seed(0)
    policies = GaussianPolicies(3, features, 1, (32, 32), -1.0, -3.0, 0.0, generator)
    taken = []
    config = CloningConfig(steps=400, learning_rate=1e-2, snapshots=(0, 50, 400))
    pool = DemonstrationPool(data)
    names = data.layout.observation_names, data.layout.action_names
    clone(policies, pool, *names, config, generator, lambda: taken.append(1))
    found = policies.act(data.observations[:, :, 5])
    np.testing.assert_allclose(found, data.actions[:, :, 5], atol=0.15)
    assert len(taken) == 3
    assert policies.log_std.eq(-1.0).all()


def test_corrective_labels_point_back_to_the_demonstration() -> None:
    config = CloningConfig(state_noise=(("b", 0.5),), recovery_labels=(("b", "u", 4.0),))
    noise, correction = perturbation(config, ("a", "b"), ("t", "u"))
    assert noise.tolist() == [0.0, 0.5]
    offset = torch.tensor([0.0, 0.1])
    torch.testing.assert_close(torch.zeros(2) - offset @ correction, torch.tensor([0.0, -0.4]))
