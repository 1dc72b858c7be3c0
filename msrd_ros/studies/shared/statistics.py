"""The paper's tests on our numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

RIVALS = ("airl_each", "airl_each_cross", "msrd_as_printed", "vanilla_distillation", "classifier")
"""Of MSRD, in strategy rewards."""
STRATEGY_PAIRS = (*(("msrd", rival) for rival in RIVALS), ("msrd_as_printed", "airl_each"))
TASK_PAIRS = (
    ("msrd", "airl"),
    ("msrd", "msrd_as_printed"),
    ("msrd", "vanilla_distillation"),
    ("msrd", "airl_each"),
)
"""Which is tested against which."""


def paired_test(ours: np.ndarray, theirs: np.ndarray) -> dict[str, float]:
    """One-tailed paired t-test (ours greater), the paper's, with the Shapiro-Wilk test of the differences.

    Where these are not normal, Wilcoxon's signed ranks say the same without that assumption.

    Parameters
    ----------
    ours, theirs
        ``[n]`` paired values.
    """
    difference = np.asarray(ours, float) - np.asarray(theirs, float)
    result: dict[str, float] = {
        "n": len(difference),
        "mean_ours": float(np.mean(ours)),
        "mean_theirs": float(np.mean(theirs)),
        "mean_difference": float(difference.mean()),
    }
    if len(difference) < 3 or float(difference.std()) == 0.0:
        return result
    test = stats.ttest_rel(ours, theirs, alternative="greater")
    shapiro = stats.shapiro(difference)
    result |= {
        "t": float(test.statistic),
        "p_one_tailed": float(test.pvalue),
        "shapiro_p": float(shapiro.pvalue),
        "wilcoxon_p": float(stats.wilcoxon(ours, theirs, alternative="greater").pvalue),
    }
    return result


def diagonal_test(hits: int, strategies: int) -> dict[str, float]:
    """Binomial test of the heatmap's diagonal against chance, one in `strategies`."""
    p = stats.binomtest(hits, strategies, 1.0 / strategies, alternative="greater").pvalue
    return {"hits": hits, "strategies": strategies, "p": float(p)}


def summarise(methods: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """All tests of the study, from the methods' scores (see `study`).

    Strategy correlations are paired by strategy and averaged over seeds first, so that n is the number of
    strategies, as in the paper; task correlations are paired by seed.
    """
    tests: dict[str, Any] = {}

    def by_strategy(name: str) -> np.ndarray | None:
        rows = methods.get(name, {}).get("strategy_r") or []
        return np.array(rows, float).mean(axis=0) if rows and rows[0] is not None else None

    for name, rival in STRATEGY_PAIRS:
        ours, theirs = by_strategy(name), by_strategy(rival)
        if ours is not None and theirs is not None:
            tests[f"strategy_r_{name}_over_{rival}"] = paired_test(ours, theirs)
    for name, rival in TASK_PAIRS:
        if name in methods and rival in methods:
            pair = [np.array(methods[one]["task_r"], float) for one in (name, rival)]
            tests[f"task_r_{name}_over_{rival}"] = paired_test(*pair)
    for name, scores in methods.items():
        hits = scores.get("diagonal") or []
        if hits and hits[0] is not None:
            count = len(scores["strategy_r"][0])
            tests[f"diagonal_{name}"] = diagonal_test(round(float(np.median(hits))), count)
    return tests
