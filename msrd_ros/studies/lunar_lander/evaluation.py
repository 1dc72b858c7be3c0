"""Marks of rewards and policies: by the true return, the other strategies and the demonstrated states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from msrd_ros.learning.environment import GymCollector
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.lunar_lander.divergence import nearest_neighbour_divergence
from msrd_ros.studies.lunar_lander.environment import LOST, make_collector, step_rewards
from msrd_ros.studies.lunar_lander.methods import PlayedEstimate
from msrd_ros.studies.lunar_lander.test_sets import TestSet
from msrd_ros.studies.shared.estimates import Estimate, Rewards
from msrd_ros.studies.shared.evaluation import correlation, mean_over, table_over

DIVERGENCE_STATES = 5000
"""States of either side at most; a strategy's three demonstrations have 1,500."""
RESOLUTIONS = {"kl": 1e-10, "kl_coarse": 0.01}
"""By mark: FLAIR's, which counts a demonstration's states at rest most of all, and a hundredth of the spread,
at which resting is one place among others."""


@dataclass(frozen=True)
class LanderTest:
    """What everything is judged on.

    Attributes
    ----------
    sets
        Trajectories, by the name of the set.
    demonstrations
        Whose own strategy reward has to be the highest, and where policies have to go.
    episodes
        Played by each strategy's policy.
    seed
        Of these episodes.
    """

    sets: Mapping[str, TestSet]
    demonstrations: Demonstrations
    episodes: int
    seed: int


def judge(estimate: Estimate, test: LanderTest) -> dict[str, Any]:
    """All marks of an estimate by name; None where the method makes no such claim.

    Of the task reward, for each set (``sets``): marks of `judge_task`. Of the strategy rewards: ``diagonal``
    and ``matrix``. Of the policies as cloned (``cloned``) and as learned (``learned``): marks of
    `judge_policies`.
    """
    marks: dict[str, Any] = {"seconds": estimate.seconds, "env_steps": estimate.environment_steps}
    marks |= {"sets": None, "diagonal": None, "matrix": None, "cloned": None, "learned": None}
    if estimate.task is not None:
        marks["sets"] = {name: judge_task(estimate.task, found) for name, found in test.sets.items()}
    if estimate.strategies is not None:
        # Demonstrations of FLAIR are all whole and equally long.
        matrix = table_over(estimate.strategies, test.demonstrations.observations).mean(axis=2)
        marks["diagonal"] = int((matrix.argmax(axis=1) == np.arange(len(matrix))).sum())
        marks["matrix"] = matrix.tolist()
    if isinstance(estimate, PlayedEstimate):
        marks["cloned"] = judge_policies(estimate.cloned, test)
        marks["learned"] = judge_policies(estimate.learned, test)
    return marks


def judge_task(task: Rewards, test: TestSet) -> dict[str, float]:
    """Mean reward over a trajectory's states against its true return: Pearson's r, Spearman's, and middle r.

    The last is r among the trajectories that neither crash nor rest.
    """
    found, middle = mean_over(task, test.observations), test.middle
    return {
        "task_r": correlation(found, test.truth),
        "task_spearman": rank_correlation(found, test.truth),
        "middle_r": correlation(found[middle], test.truth[middle]),
    }


def rank_correlation(first: NDArray[np.floating], second: NDArray[np.floating]) -> float:
    """Spearman's; 0 if one of them is constant."""
    return correlation(stats.rankdata(first), stats.rankdata(second))


def judge_policies(policies: Policies, test: LanderTest) -> dict[str, list[float]]:
    """Play them without noise; by mark, a value for each strategy (one policy for all stands for each).

    ``returns`` (mean true return), ``lost`` (share of episodes that crash or leave the bounds), and the
    divergences of `RESOLUTIONS`.
    """
    strategies = test.demonstrations.strategies
    collector: GymCollector = make_collector()
    episodes = test.episodes * strategies // policies.strategies
    played = collector.collect(policies, episodes, np.random.default_rng([test.seed, 3]), deterministic=True)
    reward = step_rewards(played).reshape(strategies, test.episodes, -1)
    states = played.observations[:, :, 1:].reshape(strategies, -1, played.observations.shape[-1])
    marks = {
        "returns": reward.sum(axis=2).mean(axis=1).tolist(),
        "lost": (reward == LOST).any(axis=2).mean(axis=1).tolist(),
    }
    for name, resolution in RESOLUTIONS.items():
        marks[name] = [
            demonstration_divergence(shown.reshape(-1, shown.shape[-1]), gone, resolution, test.seed)
            for shown, gone in zip(test.demonstrations.observations, states, strict=True)
        ]
    return marks


def demonstration_divergence(
    demonstrated: NDArray[np.floating], visited: NDArray[np.floating], resolution: float, seed: int
) -> float:
    """KL from demonstrated states ``[N, O]`` to visited ones ``[M, O]``, scaled by the former's deviation.

    Columns that are constant in the demonstrations are in their own unit.
    """
    deviation = demonstrated.std(axis=0)
    scale = np.where(deviation > 0.0, deviation, 1.0)
    rng = np.random.default_rng([seed, 4])
    samples = [
        states[rng.choice(len(states), min(len(states), DIVERGENCE_STATES), replace=False)] / scale
        for states in (demonstrated, visited)
    ]
    return nearest_neighbour_divergence(samples[0], samples[1], resolution)
