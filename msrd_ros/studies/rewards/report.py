"""The study's report: what each start and each reward reach on arms that nobody taught."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.reports.page import Report
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.studies.rewards.study import StudyPlan

TITLES = {
    "retargeting": "retargeted, corrective cloning",
    "frozen": "the same, then frozen R0 + S_i",
    "true": "the same, then the true reward",
    "frozen_from_nothing": "from nothing: frozen R0 + S_i",
    "true_from_nothing": "from nothing: the true reward",
}
COLUMNS = ("", "struck", "returned", "worst stroke", "spin right", "own reward highest, of 6")


def write_report(metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "Taught on one arm, played on another",
        "An arm is taught six strokes. Can others, which nobody shows anything, learn them from its "
        "rewards where moving its paddle's path over to them is not enough?",
    )
    report.heading("Returned")
    report.paragraph(
        f"Mean and range over {plan.seeds} seed(s); {plan.balls} balls a stroke and seed in the batched "
        "simulator, whose arms follow every command exactly. Spin right: of the returned balls. Own reward: "
        "how many of the strategy rewards are highest along their own stroke as the row plays it."
    )
    report.table(list(COLUMNS), [row_of(f"{DEFAULT_ROBOT}, which was taught", metrics["taught"])])
    for name, rows in metrics["arms"].items():
        report.heading(name)
        report.table(list(COLUMNS), [row_of(TITLES[row], results) for row, results in rows.items()])
    report.heading("By stroke")
    report.paragraph(f"Returned, mean over the seeds, in the order {', '.join(metrics['labels'])}.")
    report.table(
        ["", *metrics["labels"]],
        [
            [f"{name}: {TITLES[row]}", *(f"{100 * share:.0f} %" for share in by_stroke(results))]
            for name, rows in metrics["arms"].items()
            for row, results in rows.items()
        ],
    )
    report.heading("Conditions")
    report.paragraph(
        f"{DEFAULT_ROBOT}: {plan.taught_iterations} iterations of MSRD on the bags that ship, {plan.episodes}"
        " rollouts a stroke in each; rewards refitted on replay, then frozen. Other arms: "
        f"{plan.iterations} iterations. The arms were chosen by retargeting alone, on a seed that is not "
        "judged."
    )
    path = folder / "report.html"
    report.write(path)
    return path


def row_of(title: str, results: Sequence[dict[str, Any]]) -> list[str]:
    """One row of the table: means over strokes, then mean and range over seeds."""
    spreads = [percent([float(np.mean(found[mark])) for found in results]) for mark in ("struck", "returned")]
    worst = percent([float(np.min(found["returned"])) for found in results])
    own = ", ".join(str(found["own_reward"]) for found in results)
    return [title, *spreads, worst, percent([spin_right(found) for found in results]), own]


def spin_right(found: dict[str, Any]) -> float:
    """Share of all returned balls that have the spin of their stroke; NaN where none was returned."""
    returned, right = np.array(found["returned"]), np.array(found["spin_right"])
    return float((returned * right).sum() / returned.sum()) if returned.any() else float("nan")


def by_stroke(results: Sequence[dict[str, Any]]) -> list[float]:
    """Returned by stroke, mean over seeds, S of them."""
    return [float(share) for share in np.mean([found["returned"] for found in results], axis=0)]


def percent(shares: Sequence[float]) -> str:
    """Mean and, of several, range."""
    mean = f"{100 * np.mean(shares):.1f} %"
    return mean if len(shares) == 1 else f"{mean} ({100 * min(shares):.0f} to {100 * max(shares):.0f})"
