"""Sections of a report that every study in simulation has: marks, tests, figures, frozen rewards."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrd_ros.reports.page import Report
from msrd_ros.studies.shared import figures
from msrd_ros.studies.shared.methods import METHODS
from msrd_ros.studies.shared.runs import VirtualRuns

COLUMNS = (
    ("task_r", "task r, normalised per strategy"),
    ("task_r_pooled", "task r, raw"),
    ("task_r_unfallen", "no fall: task r, normalised per strategy"),
    ("task_r_unfallen_pooled", "no fall: task r, raw"),
    ("strategy_r", "strategy r"),
    ("strategy_r_unfallen", "strategy r, noisy, no fall"),
    ("diagonal", "diagonal"),
)
READING = (
    "Task r: Pearson correlation of mean estimated and mean true task reward over disturbed trajectories. "
    "Normalised per strategy: the values of each strategy's trajectories are first scaled to [0, 1], as in "
    "the paper, so that only the order within a strategy's own trajectories counts; raw: nothing is scaled, "
    "so that one strategy's trajectories are also compared with another's. No fall: only trajectories in "
    "which the task was never lost. Strategy r: the same correlation of strategy-only reward and true "
    "preference, for each strategy over trajectories of all strategies without injected noise, then the mean."
)


def spread(values: list[Any]) -> str:
    """Mean and deviation over seeds (and strategies), or a dash."""
    flat = np.array([value for value in values if value is not None], dtype=float)
    if not flat.size:
        return "-"
    per_seed = flat.reshape(flat.shape[0], -1).mean(axis=1)
    deviation = per_seed.std(ddof=1) if len(per_seed) > 1 else 0.0
    return f"{per_seed.mean():.3f} ± {deviation:.3f}"


def score_table(report: Report, methods: dict[str, dict[str, list[Any]]]) -> None:
    """One row per method, in the order of `COLUMNS`, then seconds and environment steps."""
    rows = []
    for name, scores in methods.items():
        row = [METHODS[name].title, *(spread(scores[column]) for column, _ in COLUMNS)]
        row.append(f"{np.mean(scores['seconds']):.0f}")
        row.append(f"{np.mean(scores['env_steps']) / 1e6:.1f}")
        rows.append(row)
    report.table(["method", *(title for _, title in COLUMNS), "seconds", "million steps"], rows)


def main_table(report: Report, metrics: dict[str, Any], paper: dict[str, tuple[str, str, str]]) -> None:
    """Marks of all methods, and the paper's.

    Parameters
    ----------
    paper
        By method: task r, strategy r, and diagonal as the paper reports them.
    """
    seeds = len(metrics["seeds"])
    report.heading("Correlation with the truth")
    report.paragraph(
        f"Mean and standard deviation over {seeds} seed(s). Every method has the same demonstrations, "
        "networks, budget and environment steps; the rewards judged are the moving average of the weights "
        "after the last planned iteration. Test trajectories are of seeds of their own."
    )
    report.paragraph(READING)
    score_table(report, metrics["methods"])
    rows = [[METHODS[name].title, *values] for name, values in paper.items()]
    report.table(["the paper", "task r, normalised", "strategy r", "diagonal"], rows)


def tests_table(report: Report, tests: dict[str, Any]) -> None:
    """Outcomes of `statistics.summarise`."""
    report.heading("Tests")
    rows = []
    for name, test in tests.items():
        if "hits" in test:
            outcome = f"{test['hits']} of {test['strategies']}, binomial p = {test['p']:.1e}"
        elif "t" in test:
            outcome = (
                f"t({test['n'] - 1}) = {test['t']:.2f}, one-tailed p = {test['p_one_tailed']:.2g}, "
                f"Shapiro-Wilk p = {test['shapiro_p']:.2g}, Wilcoxon p = {test['wilcoxon_p']:.2g}"
            )
        else:
            outcome = f"difference {test['mean_difference']:.3f}, too few pairs for a test"
        rows.append([name.replace("_", " "), outcome])
    report.table(["comparison", "outcome"], rows)


def correlation_scatter(report: Report, runs: VirtualRuns) -> None:
    """The paper's Figure 2, of the first repetition."""
    estimates = {METHODS[method].title: runs.estimate(method, 0) for method in ("msrd", "airl")}
    report.figure(
        figures.correlation_figure(estimates, runs.test_set(0)),
        "Estimated against true task reward over noise-injected trajectories, each strategy scaled to [0, 1] "
        "(the paper's Figure 2); first seed.",
    )


def strategy_bars(report: Report, methods: dict[str, dict[str, list[Any]]]) -> None:
    """The paper's Figure 3."""
    shown = ("msrd", "msrd_as_printed", "airl_each", "classifier")
    means = {METHODS[name].title: np.mean(methods[name]["strategy_r"], axis=0).tolist() for name in shown}
    report.figure(
        figures.strategy_bars(means),
        "Correlation of each strategy-only reward with the demonstrator's true preference (Figure 3); mean "
        "of seeds.",
    )


def strategy_heatmap(report: Report, methods: dict[str, dict[str, list[Any]]]) -> None:
    """The paper's Figure 5, of the first repetition."""
    shown = ("msrd", "msrd_as_printed")
    report.figure(
        figures.heatmap({METHODS[name].title: np.array(methods[name]["matrix"][0]) for name in shown}),
        "Strategy rewards (rows, scaled to [0, 1]) on every strategy's trajectories (Figure 5); first seed. "
        "A ring marks the largest value where it is on the diagonal, a cross where it is not.",
    )


def other_truths(report: Report, populations: dict[str, Any]) -> None:
    """Marks with demonstrators whose truth comes from elsewhere."""
    for kind, population in populations.items():
        if not population["methods"]:
            continue
        diagonal = np.mean(population["methods"]["oracle"]["truth_diagonal"])
        report.heading(f"Another truth: {kind.replace('_', '-')} demonstrators")
        report.paragraph(
            f"{len(population['seeds'])} seed(s). Nothing was tuned on these demonstrators, and no posterior "
            "over strategies had a hand in their preferences. By these preferences themselves "
            f"{diagonal:.1f} of {len(population['demonstrators']['kept'])} "
            "strategies score highest on their own trajectories."
        )
        score_table(report, population["methods"])
