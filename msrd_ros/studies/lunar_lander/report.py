"""The study's report: rewards on both test sets, policies, and what the sets are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.reports.page import Report
from msrd_ros.studies.lunar_lander.figures import returns_figure
from msrd_ros.studies.lunar_lander.methods import METHODS
from msrd_ros.studies.lunar_lander.study import TASK_MARKS, StudyPlan
from msrd_ros.studies.lunar_lander.test_sets import SOURCES
from msrd_ros.studies.shared import report as sections

PUBLISHED = (
    ("AIRL", ".502", "-7418", "72.0"),
    ("MSRD", ".586", "-9895", "70.9"),
    ("FLAIR", ".614", "-6347", "67.2"),
)
TITLES = {"task_r": "r", "task_spearman": "Spearman", "middle_r": "middle r"}


def write_report(metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "FLAIR's lunar lander",
        "One task, ten strategies that somebody else demonstrated, and the library's default recipe: are the "
        "shared task reward, each strategy's own reward and each strategy's policy recovered?",
    )
    _rewards(report, metrics)
    _policies(report, metrics)
    sections.tests_table(report, metrics["tests"])
    _figure(report, metrics)
    _conditions(report, metrics, plan)
    path = folder / "report.html"
    report.write(path)
    return path


def _rewards(report: Report, metrics: dict[str, Any]) -> None:
    report.heading("Rewards")
    report.paragraph(
        f"Mean and standard deviation over {len(metrics['seeds'])} seed(s). r: Pearson's correlation of the "
        "mean estimated task reward over a trajectory's states and its undiscounted true return, over all "
        "trajectories of a test set; Spearman: the same of ranks; middle r: r among trajectories that "
        "neither crash nor rest. Own: strategies, of all, whose own demonstrations score highest under "
        "their own strategy reward. The last row is no method: its reward is taught the true returns of the "
        "other test set, and says how far a reward of states can go."
    )
    names = list(metrics["sets"])
    rows = []
    for name, scores in metrics["methods"].items():
        row = [METHODS[name].title]
        for set_name in names:
            for mark in TASK_MARKS:
                values = [None if found is None else found[set_name][mark] for found in scores["sets"]]
                row.append(sections.spread(values))
        own = ", ".join("-" if hits is None else str(hits) for hits in scores["diagonal"])
        row += [own if scores["diagonal"][0] is not None else "-"]
        rows.append([*row, f"{np.mean(scores['seconds']):.0f}", f"{np.mean(scores['env_steps']) / 1e6:.2f}"])
    taught = [f"{metrics['ceiling'][set_name][mark]:.3f}" for set_name in names for mark in TASK_MARKS]
    rows.append(["taught the true returns of the other set", *taught, "-", "-", "-"])
    columns = [f"{set_name}: {TITLES[mark]}" for set_name in names for mark in TASK_MARKS]
    report.table(["method", *columns, "own", "seconds", "million steps"], rows)
    told = metrics["ceiling"].items()
    report.paragraph(
        "On the set that it was taught the last row's reward has r "
        + " and ".join(f"{found['taught_r']:.2f} (judged on {name} then)" for name, found in told)
        + ". Of the trajectories that crashed within the bounds "
        + " and ".join(f"{100 * found['standing_wrecks']:.0f} % ({name})" for name, found in told)
        + " end still and upright on both legs, as landers at rest do."
    )
    report.table(
        ["published (other trajectories, another KL)", "r", "return", "KL"], [list(row) for row in PUBLISHED]
    )


def _policies(report: Report, metrics: dict[str, Any]) -> None:
    report.heading("Policies")
    report.paragraph(
        "Mean over strategies of what policies without noise get and where they go, as cloning left them and "
        "after the last iteration. KL: from a strategy's demonstrated states to its policy's, by nearest "
        "neighbours. Demonstrated landers at rest lie in the same state again and again, and most of the "
        "first figure counts how many do; in the second nothing nearer than a hundredth of the "
        "demonstrations' deviation is told apart."
    )
    head = ["method"]
    marks = (
        ("returns", "return", "{:.0f}"),
        ("lost", "crashed", "{:.2f}"),
        ("kl", "KL", "{:.1f}"),
        ("kl_coarse", "KL at .01", "{:.1f}"),
    )
    for _, title, _ in marks:
        head += [f"{title}, cloned", f"{title}, learned"]
    rows = []
    for name, scores in metrics["methods"].items():
        if scores["learned"][0] is None:
            continue
        row = [METHODS[name].title]
        for mark, _, form in marks:
            means = [np.mean([found[mark] for found in scores[stage]]) for stage in ("cloned", "learned")]
            row += [form.format(mean) for mean in means]
        rows.append(row)
    report.table(head, rows)


def _figure(report: Report, metrics: dict[str, Any]) -> None:
    def mean_returns(name: str, stage: str) -> NDArray[np.float64]:
        found = [marks["returns"] for marks in metrics["methods"][name][stage]]
        return np.asarray(np.mean(found, axis=0))

    playing = [name for name, scores in metrics["methods"].items() if scores["learned"][0] is not None]
    if not playing:
        return
    report.heading("Figures")
    shown = {"cloned": mean_returns(playing[0], "cloned")}
    report.figure(
        returns_figure(shown | {METHODS[name].title: mean_returns(name, "learned") for name in playing}),
        "Mean true return of each strategy's policy; a method with one policy for all has one value.",
    )


def _conditions(report: Report, metrics: dict[str, Any], plan: StudyPlan) -> None:
    report.heading("Conditions")
    made = metrics["demonstrators"]
    report.paragraph(
        f"{made['strategies']} strategies, {plan.demonstrations} demonstrations of each, {made['steps']} "
        "steps long. Each action stands beside the state that it was taken at, the row before in FLAIR's "
        "file. Episodes have 500 steps and no end; the truth is the environment's own reward, also behind a "
        "crash (-100 a step, whatever becomes of the wreck) and at rest (+100)."
    )
    rows = []
    for name, found in metrics["sets"].items():
        shares = [f"{100 * found[key]:.1f} %" for key in ("below", "above", "neither", "lost_and_rested")]
        rows.append(
            [name, str(found["trajectories"]), *shares, f"{found['sd']:.0f}", *map(str, found["sources"])]
        )
    head = [
        "set",
        "trajectories",
        "below -5,000",
        "above 1,000",
        "neither crash nor rest",
        "crash and rest",
        "sd",
    ]
    report.table([*head, *SOURCES], rows)
    report.code("python -m msrd_ros reproduce flair")
