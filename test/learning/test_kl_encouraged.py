"""Demonstrators told apart by what they do in the same state: reward, truth, cached set."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.distributions import Normal, kl_divergence

from msrd_ros.learning.kl_encouraged import KLEncouragedReward, pairwise_divergence
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.inverted_pendulum.curriculum import Stage, train_in_stages
from msrd_ros.studies.inverted_pendulum.demonstrators import fresh_policies
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.truths import extrinsic, pendulum_features
from msrd_ros.studies.shared.divergence_truth import DivergenceTruth

STRATEGIES, BOUND = 4, 2.0


def policies() -> GaussianPolicies:
    generator = torch.Generator().manual_seed(0)
    found = fresh_policies(STRATEGIES, generator)
    flat = 4.0 * found.flat()
    flat[:, -1] = torch.linspace(-2.0, -0.5, STRATEGIES)
    found.set_flat(flat)
    return found


def expected(found: GaussianPolicies, states: torch.Tensor) -> torch.Tensor:
    """Equation 9 pair by pair, with torch's own divergence; ``states [S, N, 4]``."""
    rows = []
    for own in range(STRATEGIES):
        mean, log_std = found.distribution(states[own].expand(STRATEGIES, -1, -1))
        normals = [Normal(mean[i, :, 0], log_std[i, 0, 0].exp()) for i in range(STRATEGIES)]
        pairs = [
            kl_divergence(normals[own], normals[i]).clamp(max=BOUND) for i in range(STRATEGIES) if i != own
        ]
        rows.append(torch.stack(pairs).sum(dim=0))
    return torch.stack(rows).detach()


def test_divergence_is_equation_9_with_bounded_pairs() -> None:
    states = torch.randn(STRATEGIES, 30, 4, generator=torch.Generator().manual_seed(1))
    found = pairwise_divergence(policies(), states, BOUND)
    torch.testing.assert_close(found, expected(policies(), states))
    assert float(found.max()) <= BOUND * (STRATEGIES - 1)
    assert float(found.max()) > BOUND  # more than one pair counts


def test_the_same_states_may_be_given_once() -> None:
    states = torch.randn(1, 30, 4, generator=torch.Generator().manual_seed(2))
    once = pairwise_divergence(policies(), states, BOUND)
    torch.testing.assert_close(once, pairwise_divergence(policies(), states.repeat(STRATEGIES, 1, 1), BOUND))


def test_twins_have_nothing_to_gain() -> None:
    twins = policies()
    twins.set_flat(twins.flat()[:1].expand(STRATEGIES, -1))
    assert float(pairwise_divergence(twins, torch.randn(1, 20, 4), BOUND).abs().max()) < 1e-6


def test_reward_is_task_reward_and_weighted_divergence_of_the_next_state() -> None:
    played = PendulumCollector(20).collect(policies(), 2, np.random.default_rng(0))
    reward = KLEncouragedReward(extrinsic, 0.1, BOUND).reward(played, policies())
    states = torch.as_tensor(played.observations[:, :, 1:])
    divergence = expected(policies(), states.flatten(1, 2)).reshape(STRATEGIES, 2, 20)
    torch.testing.assert_close(reward, extrinsic(states) + 0.1 * divergence)


def test_truth_counts_candidates_that_were_not_kept() -> None:
    states = 100.0 * torch.randn(50, 4, generator=torch.Generator().manual_seed(3))
    table = DivergenceTruth(policies(), BOUND, (0, 2)).table(states)
    every = pairwise_divergence(policies(), states.unsqueeze(0), BOUND)
    assert torch.equal(table, every[[0, 2]])
    assert bool(torch.isfinite(table).all())


class _Upright:
    """The task alone."""

    def reward(self, rollouts: Rollouts, policies: object) -> torch.Tensor:
        return extrinsic(torch.as_tensor(rollouts.observations[:, :, 1:]))


@pytest.mark.parametrize("strategies", [1, 3])
def test_stages_are_played_as_they_are_written(strategies: int) -> None:
    training = PolicyTraining(
        fresh_policies(strategies, torch.Generator().manual_seed(0)),
        pendulum_features(),
        _Upright(),
        PendulumCollector(7),
        1,
        TrustRegionConfig(),
        ValueConfig(hidden=(8,), steps=1, sees_time=False, bootstrap=True),
        seed=0,
    )
    said: list[str] = []
    train_in_stages(training, (Stage(2, 3, 5), Stage(1, 2, 11)), progress=said.append)
    assert training.environment_steps == strategies * (2 * 3 * 5 + 1 * 2 * 11)
    assert len(said) == 2
