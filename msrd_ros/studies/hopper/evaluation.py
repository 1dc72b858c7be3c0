"""Marks that the Hopper study adds: ranks, gaits that nobody demonstrated, and strategies on noisy ground."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from msrd_ros.studies.hopper.demonstrators import Demonstrators
from msrd_ros.studies.hopper.environment import mean_speed
from msrd_ros.studies.hopper.task import HOPPER, NOISE_LEVELS, make_collector
from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.evaluation import (
    TestSet,
    correlation,
    evaluate,
    make_test_set,
    mean_over,
    table_over,
)


@dataclass(frozen=True)
class GaitTestSet:
    """Trajectories to judge rewards on.

    Attributes
    ----------
    demonstrated
        Hop and crawl, with and without injected noise.
    noisy_truth
        ``[2, 2, n]``: mean true strategy reward i of each noisy trajectory of each strategy.
    unbounded_truth
        The same of log q without the floor that the pseudo-reward had while the demonstrators trained.
    unseen
        ``[G, n, T+1, 12]``: every gait that nobody demonstrated, without injected noise.
    """

    demonstrated: TestSet
    noisy_truth: NDArray[np.float64]
    unbounded_truth: NDArray[np.float64]
    unseen: NDArray[np.float32]

    __test__ = False

    @property
    def acted(self) -> NDArray[np.bool_]:
        """Noisy trajectories of a strategy in which it has any part: not every action is random, ``[n]``."""
        levels = np.array(NOISE_LEVELS)
        return np.repeat(levels < 1.0, self.noisy_truth.shape[2] // len(levels))


def make_gait_test_set(
    demonstrators: Demonstrators, seed: int, repeats: int = 3, clean: int = 5, unseen: int = 1
) -> GaitTestSet:
    """Play demonstrators and the other gaits.

    Parameters
    ----------
    seed
        Of a range of its own: test trajectories are never demonstrations.
    repeats, clean, unseen
        Trajectories per strategy and noise level, per strategy without noise, per gait nobody demonstrated.
    """
    demonstrated = make_test_set(HOPPER, demonstrators, seed, repeats, clean)
    others = make_collector(HOPPER.horizon).collect(
        demonstrators.others, unseen, np.random.default_rng([seed, 8])
    )
    truth = demonstrators.truth
    paid, unbounded = (table_over(form.table, demonstrated.noisy) for form in (truth, truth.unbounded()))
    return GaitTestSet(demonstrated, paid, unbounded, others.observations)


def judge(estimate: Estimate, test: GaitTestSet) -> dict[str, Any]:
    """All marks of an estimate by name; None where the method makes no such claim.

    Beside those of `shared.evaluation.Scores` and what the run took: ``task_r_spearman`` (all noisy
    trajectories), ``task_r_each`` (per strategy), ``task_r_unseen`` and ``task_r_unseen_spearman`` (gaits
    that nobody demonstrated), ``strategy_r`` (noisy trajectories of both strategies), ``strategy_r_own`` (of
    the strategy itself, the paper's), ``strategy_r_clean`` (of both, without noise),
    ``strategy_r_unbounded`` (as ``strategy_r``, against log q without its floor) and ``strategy_r_acted``
    (as ``strategy_r``, without the trajectories of pure chance: hop and crawl are the same there, nobody's
    preference shows, and the posterior, which has never been there, says anything).
    """
    noisy = test.demonstrated.noisy
    marks: dict[str, Any] = asdict(evaluate(estimate, test.demonstrated))
    marks |= {"seconds": estimate.seconds, "env_steps": estimate.environment_steps}
    marks["truth_diagonal"] = test.demonstrated.truth_diagonal
    marks["fallen_share"] = float(test.demonstrated.fallen[0].mean())
    marks |= {"strategy_r_clean": marks["strategy_r"], "strategy_r": None, "strategy_r_own": None}
    marks |= {"strategy_r_unbounded": None, "strategy_r_acted": None}
    marks |= dict.fromkeys(("task_r_spearman", "task_r_each", "task_r_unseen", "task_r_unseen_spearman"))
    if estimate.task is not None:
        truth, found = test.demonstrated.task_truth, mean_over(estimate.task, noisy)
        marks["task_r_spearman"] = float(stats.spearmanr(found.ravel(), truth.ravel()).statistic)
        marks["task_r_each"] = [correlation(*pair) for pair in zip(found, truth, strict=True)]
        speed, guessed = mean_speed(test.unseen).ravel(), mean_over(estimate.task, test.unseen).ravel()
        marks["task_r_unseen"] = correlation(guessed, speed)
        marks["task_r_unseen_spearman"] = float(stats.spearmanr(guessed, speed).statistic)
    if estimate.strategies is not None:
        found, truth = table_over(estimate.strategies, noisy), test.noisy_truth
        strategies = range(len(found))
        marks["strategy_r"] = [correlation(found[i], truth[i]) for i in strategies]
        marks["strategy_r_own"] = [correlation(found[i, i], truth[i, i]) for i in strategies]
        acted = test.acted
        marks["strategy_r_acted"] = [correlation(found[i][:, acted], truth[i][:, acted]) for i in strategies]
        marks["strategy_r_unbounded"] = [correlation(found[i], test.unbounded_truth[i]) for i in strategies]
    return marks
