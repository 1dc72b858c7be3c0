"""Estimates against the truth, on trajectories that neither training nor tuning has seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.studies.shared.estimates import Estimate, Rewards
from msrd_ros.studies.shared.task import Demonstrators, VirtualTask

UNFALLEN_STRIDE = 5
"""Strategy rewards of noisy trajectories are averaged over every fifth step: there are many of them."""


@dataclass(frozen=True)
class TestSet:
    """Trajectories to judge rewards on.

    Attributes
    ----------
    noisy
        ``[S, L * repeats, T+1, O]``: every strategy at every noise level.
    clean
        ``[S, n, T+1, O]``: every strategy without injected noise.
    clean_truth
        ``[S, S * n]``: mean true strategy reward i of each clean trajectory.
    unfallen_truth
        ``[S, m]``: the same for noisy trajectories without a fall, of all strategies.
    fallen
        Which noisy trajectories fell, ``[S, L * repeats]``.
    task_truth
        Mean true task reward of the noisy trajectories, ``[S, L * repeats]``.
    """

    noisy: NDArray[np.float32]
    clean: NDArray[np.float32]
    clean_truth: NDArray[np.float64]
    unfallen_truth: NDArray[np.float64]
    fallen: NDArray[np.bool_]
    task_truth: NDArray[np.float64]

    __test__ = False

    @property
    def unfallen(self) -> NDArray[np.float32]:
        """Noisy trajectories without a fall, ``[m, T+1, O]``."""
        return self.noisy[~self.fallen]

    @property
    def truth_diagonal(self) -> int:
        """Strategies whose own clean trajectories score highest under their own true preference."""
        strategies = self.clean.shape[0]
        return _diagonal(self.clean_truth.reshape(strategies, strategies, -1).mean(axis=2))


def make_test_set(
    task: VirtualTask, demonstrators: Demonstrators, seed: int, repeats: int = 2, clean: int = 5
) -> TestSet:
    """Play the demonstrators with noise injected into their actions (paper, Section 6.1).

    Parameters
    ----------
    seed
        Of a range of its own: test trajectories are never demonstrations.
    repeats
        Trajectories per strategy and noise level.
    clean
        Trajectories per strategy without injected noise, for the strategy rewards.
    """
    strategies = demonstrators.policies.strategies
    rng = np.random.default_rng([seed, 7])
    levels = np.tile(np.repeat(np.array(task.noise_levels), repeats), (strategies, 1))
    disturbed = task.make_collector(task.horizon, levels)
    noisy = disturbed.collect(demonstrators.policies, levels.shape[1], rng)
    plain = task.make_collector(task.horizon).collect(demonstrators.policies, clean, rng)
    fallen = task.has_fallen(noisy.observations)
    unfallen = noisy.observations[~fallen]
    flat = plain.observations.reshape(-1, *plain.observations.shape[2:])
    truth = demonstrators.truth.table
    return TestSet(
        noisy.observations,
        plain.observations,
        table_over(truth, flat),
        table_over(truth, unfallen, UNFALLEN_STRIDE),
        fallen,
        task.task_reward(noisy.observations[:, :, 1:]).mean(axis=2),
    )


def mean_over(rewards: Rewards, trajectories: NDArray[np.floating]) -> NDArray[np.float64]:
    """Mean reward per step of ``trajectories [..., T+1, O]`` under ``[N, O] -> [N]``, ``[...]``."""
    means: NDArray[np.float64] = table_over(lambda states: rewards(states).unsqueeze(0), trajectories)[0]
    return means


def table_over(rewards: Rewards, trajectories: NDArray[np.floating], stride: int = 1) -> NDArray[np.float64]:
    """Mean reward of every `stride`-th step of trajectories under ``[N, O] -> [S, N]``, ``[S, ...]``."""
    lead = trajectories.shape[:-2]
    rows = trajectories.reshape(-1, *trajectories.shape[-2:])[:, 1::stride]
    steps = rows.shape[1]
    columns = []
    for start in range(0, rows.shape[0], 64):
        states: Tensor = torch.as_tensor(np.ascontiguousarray(rows[start : start + 64]), dtype=torch.float32)
        values = rewards(states.reshape(-1, states.shape[-1])).double()
        columns.append(values.reshape(values.shape[0], -1, steps).mean(dim=2).numpy())
    table = np.concatenate(columns, axis=1)
    return table.reshape(table.shape[0], *lead)


def correlation(first: NDArray[np.floating], second: NDArray[np.floating]) -> float:
    """Pearson's r of all values; 0 if one of them is constant (it then explains nothing)."""
    a, b = np.asarray(first, float).ravel(), np.asarray(second, float).ravel()
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0


def normalised(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Each row scaled to [0, 1], as in the paper's correlation figure and heatmap."""
    low, high = values.min(axis=1, keepdims=True), values.max(axis=1, keepdims=True)
    return np.asarray((values - low) / np.maximum(high - low, 1e-12), dtype=np.float64)


def task_correlation(task: Rewards, test: TestSet) -> float:
    """Task reward against the truth over all noisy trajectories, normalised per strategy (the paper's)."""
    return correlation(normalised(mean_over(task, test.noisy)), normalised(test.task_truth))


@dataclass(frozen=True)
class Scores:
    """An estimate's marks; None where the method makes no such claim.

    Attributes
    ----------
    task_r
        Task reward against the truth over all noisy trajectories, normalised per strategy (the paper's).
    task_r_pooled
        The same without normalisation.
    task_r_unfallen
        Over trajectories in which the task was never lost, normalised per strategy.
    task_r_unfallen_pooled
        The same without normalisation.
    strategy_r
        Per strategy: strategy-only reward against the true preference over clean trajectories of all
        strategies.
    strategy_r_unfallen
        The same over noisy trajectories without a fall.
    diagonal
        Strategies whose own clean trajectories score highest under their own reward.
    matrix
        ``[S][S]`` mean strategy reward i of clean trajectories of strategy j.
    """

    task_r: float | None
    task_r_pooled: float | None
    task_r_unfallen: float | None
    task_r_unfallen_pooled: float | None
    strategy_r: list[float] | None
    strategy_r_unfallen: list[float] | None
    diagonal: int | None
    matrix: list[list[float]] | None


def evaluate(estimate: Estimate, test: TestSet) -> Scores:
    """Mark an estimate on a test set."""
    scores = Scores(None, None, None, None, None, None, None, None)
    if estimate.task is not None:
        truth = test.task_truth
        found = mean_over(estimate.task, test.noisy)
        up = ~test.fallen
        scores = replace(
            scores,
            task_r=correlation(normalised(found), normalised(truth)),
            task_r_pooled=correlation(found, truth),
            task_r_unfallen=_unfallen_normalised(found, truth, up),
            task_r_unfallen_pooled=correlation(found[up], truth[up]),
        )
    if estimate.strategies is None:
        return scores
    clean = table_over(estimate.strategies, test.clean)
    strategies = clean.shape[0]
    flat = clean.reshape(strategies, -1)
    unfallen = table_over(estimate.strategies, test.unfallen, UNFALLEN_STRIDE)
    matrix = clean.mean(axis=2)
    return replace(
        scores,
        strategy_r=[correlation(flat[i], test.clean_truth[i]) for i in range(strategies)],
        strategy_r_unfallen=[correlation(unfallen[i], test.unfallen_truth[i]) for i in range(strategies)],
        diagonal=_diagonal(matrix),
        matrix=matrix.tolist(),
    )


def _diagonal(matrix: NDArray[np.float64]) -> int:
    """Rows of ``[S, S]`` whose largest value is on the diagonal."""
    return int((matrix.argmax(axis=1) == np.arange(len(matrix))).sum())


def _unfallen_normalised(
    found: NDArray[np.float64], truth: NDArray[np.float64], up: NDArray[np.bool_]
) -> float:
    """Correlation over unfallen trajectories, each strategy's scaled to [0, 1] over its own."""
    pairs = []
    for row in range(found.shape[0]):
        if up[row].sum() >= 2:
            both = np.stack([found[row, up[row]], truth[row, up[row]]])
            pairs.append(normalised(both))
    if not pairs:
        return 0.0
    joined = np.concatenate(pairs, axis=1)
    return correlation(joined[0], joined[1])
