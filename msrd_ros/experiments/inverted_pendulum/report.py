"""The study's report: figures and tables of ours beside the paper's numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.experiments.inverted_pendulum import figures
from msrd_ros.experiments.inverted_pendulum.demonstrators import cached_demonstrators
from msrd_ros.experiments.inverted_pendulum.evaluation import make_test_set
from msrd_ros.experiments.inverted_pendulum.methods import Method
from msrd_ros.experiments.inverted_pendulum.study import TEST_SEED, StudyPlan, restored
from msrd_ros.experiments.report import Report

NAMES = {
    "msrd": "MSRD with cross-negatives",
    "msrd_as_printed": "MSRD as printed",
    "vanilla_distillation": "vanilla distillation, same terms",
    "airl": "AIRL on all demonstrations",
    "airl_each": "AIRL per strategy",
    "airl_each_cross": "AIRL per strategy, same terms",
    "classifier": "softmax classifier, no inverse RL",
    "oracle": "oracle: distance to the strategy's cart position",
}
PAPER = {
    "msrd_as_printed": ("0.998", "0.779", "16"),
    "airl": ("0.51", "", ""),
    "airl_each": ("", "0.635", ""),
}
COLUMNS = (
    ("task_r", "task r, normalised per strategy"),
    ("task_r_pooled", "task r, pooled"),
    ("task_r_unfallen", "task r, no fall"),
    ("strategy_r", "strategy r"),
    ("strategy_r_unfallen", "strategy r, noisy, no fall"),
    ("diagonal", "diagonal"),
)


def write_report(metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "Inverted pendulum",
        "One task, twenty strategies: are the shared task reward and each strategy's own reward recovered?",
    )
    _main_table(report, metrics)
    _tests(report, metrics["tests"])
    _draw(report, metrics, plan, folder)
    _other_truths(report, metrics["other_truths"])
    _transfer(report, metrics["transfer"])
    _conditions(report, metrics)
    path = folder / "report.html"
    report.write(path)
    return path


def spread(values: list[Any]) -> str:
    """Mean and deviation over seeds (and strategies), or a dash."""
    flat = np.array([value for value in values if value is not None], dtype=float)
    if not flat.size:
        return "-"
    per_seed = flat.reshape(flat.shape[0], -1).mean(axis=1)
    deviation = per_seed.std(ddof=1) if len(per_seed) > 1 else 0.0
    return f"{per_seed.mean():.3f} ± {deviation:.3f}"


def score_rows(methods: dict[str, dict[str, list[Any]]]) -> list[list[str]]:
    """One row per method, in the order of `COLUMNS`, then seconds and environment steps."""
    rows = []
    for name, scores in methods.items():
        row = [NAMES[name], *(spread(scores[column]) for column, _ in COLUMNS)]
        row.append(f"{np.mean(scores['seconds']):.0f}")
        row.append(f"{np.mean(scores['env_steps']) / 1e6:.1f}")
        rows.append(row)
    return rows


def _main_table(report: Report, metrics: dict[str, Any]) -> None:
    seeds = len(metrics["seeds"])
    report.heading("Correlation with the truth")
    report.paragraph(
        f"Mean and standard deviation over {seeds} seed(s). Every method has the same demonstrations, "
        "networks, budget and environment steps; the rewards judged are the moving average of the weights "
        "after the last planned sweep. Test trajectories are of seeds of their own."
    )
    head = ["method", *(title for _, title in COLUMNS), "seconds", "million steps"]
    report.table(head, score_rows(metrics["methods"]))
    rows = [[NAMES[name], *values] for name, values in PAPER.items()]
    report.table(["the paper", "task r, normalised", "strategy r", "diagonal of 20"], rows)


def _tests(report: Report, tests: dict[str, Any]) -> None:
    report.heading("Tests")
    rows = []
    for name, test in tests.items():
        if "hits" in test:
            outcome = f"{test['hits']} of {test['strategies']}, binomial p = {test['p']:.1e}"
        elif "t" in test:
            outcome = (
                f"t({test['n'] - 1}) = {test['t']:.2f}, one-tailed p = {test['p_one_tailed']:.2g}, "
                f"Shapiro-Wilk p = {test['shapiro_p']:.2f}"
            )
        else:
            outcome = f"difference {test['mean_difference']:.3f}, too few pairs for a test"
        rows.append([name.replace("_", " "), outcome])
    report.table(["comparison", "outcome"], rows)


def _draw(report: Report, metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> None:
    demonstrators = cached_demonstrators(plan.kinds[0])
    test = make_test_set(demonstrators, TEST_SEED, plan.test_repeats, plan.test_clean)
    estimates = {
        name: restored(plan, demonstrators, Method(name), 0, folder / "runs")
        for name in ("msrd", "airl", "msrd_as_printed")
    }
    methods = metrics["methods"]
    report.heading("Figures")
    report.figure(
        figures.correlation_figure({NAMES[name]: estimates[name] for name in ("msrd", "airl")}, test),
        "Estimated against true task reward over noise-injected trajectories, each strategy scaled to [0, 1] "
        "(the paper's Figure 2); first seed.",
    )
    bars = ("msrd", "msrd_as_printed", "airl_each", "classifier")
    report.figure(
        figures.strategy_bars(
            {NAMES[name]: np.mean(methods[name]["strategy_r"], axis=0).tolist() for name in bars}
        ),
        "Correlation of each strategy-only reward with the demonstrator's true preference (Figure 3); mean "
        "of seeds.",
    )
    report.figure(
        figures.reward_curves(estimates["msrd"], test),
        "Rewards over the pole's angle, everything else at zero, and what the demonstrators do (Figure 4): "
        "the two strategies whose reward leans furthest to either side are drawn dark.",
    )
    report.figure(
        figures.heatmap(
            {NAMES[name]: np.array(methods[name]["matrix"][0]) for name in ("msrd", "msrd_as_printed")}
        ),
        "Strategy rewards (rows, scaled to [0, 1]) on every strategy's trajectories (Figure 5); first seed. "
        "A ring marks the largest value where it is on the diagonal, a cross where it is not.",
    )


def _other_truths(report: Report, populations: dict[str, Any]) -> None:
    for kind, population in populations.items():
        if not population["methods"]:
            continue
        report.heading(f"Another truth: {kind.replace('_', '-')} demonstrators")
        report.paragraph(
            f"{len(population['seeds'])} seed(s). Nothing was tuned on these demonstrators, and no posterior "
            "over strategies had a hand in their preferences."
        )
        head = ["method", *(title for _, title in COLUMNS), "seconds", "million steps"]
        report.table(head, score_rows(population["methods"]))


def _transfer(report: Report, transfer: dict[str, Any]) -> None:
    if not transfer:
        return
    report.heading("Fresh policies on frozen rewards")
    report.paragraph(
        "Policies trained from scratch on what was inferred (first seed), where it was demonstrated and "
        "where the dynamics have changed. Style distance: how far the cart settles from the demonstrator's. "
        "Means over the twenty strategies."
    )
    for body, table in transfer.items():
        rows = []
        for method, rewards in table.items():
            for reward, marks in rewards.items():
                cells = [float(np.mean(marks[name])) for name in ("task_return", "fallen")]
                style = float(np.mean(marks["style_distance_m"]))
                liking = float(np.mean(marks["true_preference"]))
                row = [NAMES.get(method, method), reward, f"{cells[0]:.3f}", f"{100 * cells[1]:.0f} %"]
                rows.append([*row, f"{style:.2f}", f"{liking:.2f}"])
        head = ["rewards of", "optimised", "task return", "falls", "style distance (m)", "true preference"]
        report.table(head, rows, f"Dynamics {body}.")


def _conditions(report: Report, metrics: dict[str, Any]) -> None:
    report.heading("Conditions")
    made = metrics["demonstrators"]
    fallen = np.mean(metrics["methods"]["oracle"]["fallen_share"])
    report.paragraph(
        f"{made['able']} of {made['candidates']} trained candidates stayed up; 20 were kept by distinctness. "
        f"Their task return is {np.mean(made['task_return']):.4f} rad a step, and a classifier of single "
        f"states recognises them in {100 * np.mean(made['recognised']):.0f} % of states. "
        f"{100 * fallen:.0f} % of the "
        "noise-injected test trajectories fall, which makes the normalised correlation easier: hence the "
        "column without falls."
    )
    report.code("python -m msrd_ros reproduce inverted_pendulum")
