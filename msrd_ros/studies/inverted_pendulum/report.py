"""The study's report: figures and tables of ours beside the paper's numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.reports.page import Report
from msrd_ros.studies.inverted_pendulum.figures import reward_curves, settled_places
from msrd_ros.studies.inverted_pendulum.study import StudyPlan
from msrd_ros.studies.shared import report as sections
from msrd_ros.studies.shared.methods import METHODS

PAPER = {
    "msrd_as_printed": ("0.998", "0.779", "16 of 20"),
    "airl": ("0.51", "", ""),
    "airl_each": ("", "0.635", ""),
}


def write_report(metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "Inverted pendulum",
        "One task, twenty strategies: are the shared task reward and each strategy's own reward recovered?",
    )
    sections.main_table(report, metrics, PAPER)
    sections.tests_table(report, metrics["tests"])
    _draw(report, metrics, plan, folder)
    sections.other_truths(report, metrics["other_truths"])
    _transfer(report, metrics["transfer"])
    _conditions(report, metrics)
    path = folder / "report.html"
    report.write(path)
    return path


def _draw(report: Report, metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> None:
    runs = plan.runs(plan.kinds[0], folder / "runs")
    report.heading("Figures")
    sections.correlation_scatter(report, runs)
    sections.strategy_bars(report, metrics["methods"])
    report.figure(
        reward_curves(runs.estimate("msrd", 0), runs.test_set(0)),
        "Rewards over the pole's angle, everything else at zero, and what the demonstrators do (Figure 4): "
        "the two strategies whose reward leans furthest to either side are drawn dark.",
    )
    sections.strategy_heatmap(report, metrics["methods"])


def _transfer(report: Report, transfer: dict[str, Any]) -> None:
    if not transfer:
        return
    report.heading("Fresh policies on frozen rewards")
    report.paragraph(
        "Policies trained from scratch on what was inferred (first seed), where it was demonstrated and "
        "where the dynamics have changed. Style distance: how far the cart settles from the demonstrator's. "
        "Means over the twenty strategies."
    )
    homes = transfer["as demonstrated"]["demonstrators"]["their own policies"]["cart_position"]
    for body, table in transfer.items():
        rows = []
        for method, rewards in table.items():
            for reward, marks in rewards.items():
                cells = [float(np.mean(marks[name])) for name in ("task_return", "fallen")]
                style = float(np.mean(marks["style_distance_m"]))
                liking = float(np.mean(marks["true_preference"]))
                row = [
                    METHODS[method].title if method in METHODS else method,
                    reward,
                    f"{cells[0]:.3f}",
                    f"{100 * cells[1]:.0f} %",
                ]
                rows.append([*row, f"{style:.2f}", f"{liking:.2f}"])
        head = ["rewards of", "optimised", "task return", "falls", "style distance (m)", "true preference"]
        report.table(head, rows, f"Dynamics {body}.")
        shown = {
            "true R0 + 0.1 S_i": table["truth"]["true R0 + 0.1 S_i"],
            "MSRD: R0 + S_i": table["msrd"]["R0 + S_i"],
            "MSRD: R0 alone": table["msrd"]["R0 alone"],
            "AIRL each, same terms: R_i": table["airl_each_cross"]["R0 + S_i"],
            "classifier: log q": table["classifier"]["S_i alone"],
        }
        report.figure(
            settled_places(homes, shown),
            f"Where the fresh policies settle and where their demonstrators did, dynamics {body}.",
        )


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
        "columns without falls."
    )
    report.code("python -m msrd_ros reproduce inverted_pendulum")
