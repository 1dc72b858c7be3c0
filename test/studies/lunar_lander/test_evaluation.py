"""Marks: rewards on made-up trajectories, policies where they are played, and tests between methods."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

pytest.importorskip("Box2D")

from msrd_ros.learning.layout import Layout
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.trajectories import Demonstrations, Rollouts
from msrd_ros.studies.lunar_lander.evaluation import (
    LanderTest,
    demonstration_divergence,
    judge,
    judge_policies,
    judge_task,
    rank_correlation,
)
from msrd_ros.studies.lunar_lander.study import summarise
from msrd_ros.studies.lunar_lander.test_sets import TestSet
from msrd_ros.studies.shared.estimates import Estimate


def made_up_set() -> TestSet:
    """40 trajectories whose first column says the truth, wrongly so where they neither crash nor rest."""
    rng = np.random.default_rng(0)
    level = np.concatenate([np.full(10, -5.0), np.linspace(-0.5, 0.5, 20), np.full(10, 5.0)])
    shown = np.concatenate([level[:10], -level[10:30], level[30:]])
    states = rng.normal(0.0, 1e-3, (40, 11, 8)).astype(np.float32)
    states[:, 1:, 0] += shown[:, None].astype(np.float32)
    states[:, 0] = 1e3  # nobody is paid for where an episode starts
    index = np.arange(40)
    return TestSet(states, 1000.0 * level, index < 10, index >= 30, index % 3)


def first_column(states: torch.Tensor) -> torch.Tensor:
    return states[..., 0]


def test_the_middle_is_what_neither_crashes_nor_rests() -> None:
    marks = judge_task(first_column, made_up_set())
    assert marks["task_r"] > 0.95
    assert marks["middle_r"] == pytest.approx(-1.0, abs=1e-3)
    assert marks["middle_r"] < marks["task_spearman"] < marks["task_r"]


def test_ranks_count_ties_alike() -> None:
    first = np.array([1.0, 2.0, 2.0, 100.0])
    assert rank_correlation(first, np.array([0.0, 1.0, 1.0, 2.0])) == pytest.approx(1.0)
    assert rank_correlation(first, np.ones(4)) == 0.0


def test_sets_tell_their_spread() -> None:
    found = made_up_set().describe()
    assert found["neither"] == 0.5
    assert (found["below"], found["above"]) == (0.0, 0.25)  # -5,000 itself is not below it
    assert found["sources"] == [14, 13, 13]


def test_a_set_of_rollouts_knows_its_crashes() -> None:
    reward = np.zeros((2, 2, 3), np.float32)
    reward[0, 1, 1:] = -100.0
    reward[1, 0, 2] = 100.0
    played = Rollouts(
        np.zeros((2, 2, 4, 8), np.float32),
        np.zeros((2, 2, 3, 2), np.float32),
        np.zeros((2, 2, 3), np.float32),
        environment_reward=reward,
    )
    found = TestSet.join([TestSet.of([played], 2), TestSet.of([played, played], 0)])
    assert found.truth.tolist() == [0.0, -200.0, 100.0, 0.0] * 3
    assert found.lost.tolist() == [False, True, False, False] * 3
    assert found.rested.tolist() == [False, False, True, False] * 3
    assert found.source.tolist() == [2] * 4 + [0] * 8
    assert found.observations.shape == (12, 4, 8)


def demonstrations() -> Demonstrations:
    """Two strategies, which stay at x = -1 and x = 1."""
    rng = np.random.default_rng(1)
    states = rng.normal(0.0, 0.1, (2, 3, 41, 8))
    states[..., 0] += np.array([-1.0, 1.0])[:, None, None]
    return Demonstrations(
        states, np.zeros((2, 3, 40, 2)), Layout(tuple("abcdefgh"), ("m", "s"), ("l", "r"), 0.02)
    )


def test_own_demonstrations_have_to_score_highest() -> None:
    def sides(states: torch.Tensor) -> torch.Tensor:
        return torch.stack([-states[:, 0], states[:, 0]])

    test = LanderTest({"A": made_up_set()}, demonstrations(), 1, 5)
    marks = judge(Estimate(first_column, sides, None, {}, 0.0, 0), test)
    assert marks["diagonal"] == 2
    assert marks["sets"]["A"]["task_r"] > 0.95
    assert marks["learned"] is None
    same = judge(Estimate(None, lambda states: sides(states)[[1, 1]], None, {}, 0.0, 0), test)
    assert same["diagonal"] == 1
    assert same["sets"] is None


@pytest.mark.parametrize("strategies", [1, 2])
def test_policies_are_judged_strategy_by_strategy(strategies: int) -> None:
    features = Features(tuple(range(8)), (0.0,) * 8, (1.0,) * 8)
    generator = torch.Generator().manual_seed(0)
    policies = GaussianPolicies(strategies, features, 2, (4,), -2.0, -3.0, 0.0, generator)
    test = LanderTest({}, demonstrations(), 2, 5)
    marks = judge_policies(policies, test)
    assert {len(values) for values in marks.values()} == {2}
    assert marks["lost"] == [1.0, 1.0]  # engines that hardly fire
    assert max(marks["returns"]) < -1000.0
    assert judge_policies(policies, test) == marks


def test_divergence_is_scaled_by_the_demonstrations() -> None:
    rng = np.random.default_rng(3)
    demonstrated, visited = rng.standard_normal((2, 2000, 3))
    visited[:, 0] += 1.0
    units = np.array([1e-3, 1.0, 1e3])
    plain = demonstration_divergence(demonstrated, visited, 1e-10, 0)
    assert demonstration_divergence(demonstrated * units, visited * units, 1e-10, 0) == pytest.approx(plain)
    assert plain > 0.2
    assert demonstration_divergence(demonstrated * [1, 1, 0], visited * [1, 1, 0], 1e-10, 0) > 0.2


def test_methods_are_compared_seed_by_seed_and_strategy_by_strategy() -> None:
    def scores(task: float, returns: float, kl: float) -> dict[str, list[Any]]:
        noise = (0.0, 0.01, 0.03)
        sets = [
            {
                name: dict.fromkeys(("task_r", "task_spearman", "middle_r"), task + one * (task > 0.5))
                for name in "AB"
            }
            for one in noise
        ]
        played = {"returns": [returns, returns + 1.0, returns - 9.0], "kl": [kl, kl + 0.1, kl + 0.3]}
        return {
            "sets": sets,
            "learned": [played] * 3,
            "diagonal": [3] * 3,
            "matrix": [np.eye(3).tolist()] * 3,
        }

    ours, theirs = scores(0.6, 0.0, 5.0), scores(0.5, -3.0, 6.0)
    theirs["learned"] = [{"returns": [-3.0, -3.0, -3.0], "kl": [6.0, 6.0, 6.0]}] * 3
    tests = summarise({"msrd": ours, "airl": theirs})
    assert tests["middle_r_B_msrd_over_airl"]["n"] == 3
    assert tests["task_r_A_msrd_over_airl"]["mean_difference"] == pytest.approx(0.1133, abs=1e-3)
    assert tests["returns_msrd_over_airl"]["better_in"] == 2
    assert tests["kl_msrd_over_airl"]["better_in"] == 3
    assert tests["kl_msrd_over_airl"]["mean_difference"] == pytest.approx(0.8667, abs=1e-3)
    assert tests["diagonal_msrd"]["hits"] == 3
    assert "task_r_A_msrd_over_nearness" not in tests
