"""The study's report: figures and tables of ours beside the paper's numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.reports.page import Report
from msrd_ros.studies.hopper.demonstrators import LABELS
from msrd_ros.studies.hopper.figures import strategy_strips
from msrd_ros.studies.hopper.study import TASK_MARKS, StudyPlan
from msrd_ros.studies.shared import figures
from msrd_ros.studies.shared import report as sections
from msrd_ros.studies.shared.methods import METHODS

COLUMNS = (
    ("task_r", "task r, normalised per strategy"),
    ("task_r_pooled", "task r, raw"),
    ("task_r_spearman", "Spearman"),
    ("task_r_unfallen", "no fall: task r, normalised"),
    ("task_r_unseen", "unseen gaits: task r"),
    ("task_r_unseen_spearman", "Spearman"),
)
STRATEGY_COLUMNS = (
    ("strategy_r", "both, noisy"),
    ("strategy_r_acted", "without pure chance"),
    ("strategy_r_unbounded", "without the floor"),
    ("strategy_r_own", "own, noisy"),
    ("strategy_r_clean", "both, clean"),
)
PAPER = (
    ("MSRD", "0.943", "0.85 / 0.93"),
    ("AIRL on all demonstrations", "0.89", ""),
    ("AIRL per strategy", "", "0.80 / 0.82"),
)


def write_report(metrics: dict[str, Any], plan: StudyPlan, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "Hopper",
        "One goal, two gaits: are the wish to get ahead and the taste for hopping or crawling recovered?",
    )
    _tables(report, metrics)
    sections.tests_table(report, metrics["tests"])
    _draw(report, plan, folder)
    _transfer(report, metrics["transfer"])
    _other_truths(report, metrics["other_truths"])
    _conditions(report, metrics)
    path = folder / "report.html"
    report.write(path)
    return path


def _tables(report: Report, metrics: dict[str, Any]) -> None:
    methods = metrics["methods"]
    report.heading("Task reward")
    report.paragraph(
        f"Mean and standard deviation over {len(metrics['seeds'])} run(s): each seed with each of "
        f"{len(metrics['demonstrators'])} independently trained pair(s) of demonstrators. Every method has "
        "the same demonstrations, networks, budget and environment steps; the rewards judged are the moving "
        "average of the weights after the last planned iteration. Task r: correlation of mean estimated "
        "reward with the true mean speed, over noise-injected trajectories of hop and crawl; over gaits that "
        "no method has ever seen; over hops that never fell and all crawls."
    )
    _task_table(report, methods)
    report.heading("Strategy rewards")
    report.paragraph(
        "Correlation of the strategy-only reward with the demonstrator's true preference, hop / crawl: over "
        "noise-injected trajectories of both strategies (the sound ground), over those of the strategy "
        "itself (the paper's), and over both strategies' trajectories without noise. The preference is the "
        "pseudo-reward as it was paid: log q above chance, at least -5 nats. Two columns more: without the "
        "trajectories of nothing but random actions, in which nobody's preference shows and q says "
        "anything, and against log q without its floor, which runs to -24 where q has never been."
    )
    _strategy_table(report, methods)
    report.table(["the paper", "task r, normalised", "strategy r, own, hop / crawl"], PAPER)
    _pairs_table(report, metrics)


def _pairs_table(report: Report, metrics: dict[str, Any]) -> None:
    """MSRD pair by pair: what differs between pairs is more than what differs between seeds."""
    report.heading("Pair by pair")
    report.paragraph(
        "Marks of MSRD, and of the regression that knows the true preferences of all demonstrated states: "
        "where it fails, demonstrations do not tell."
    )
    ours, supervised = metrics["methods"]["msrd"], metrics["methods"]["supervised"]
    rows = []
    for pair in metrics["demonstrators"]:
        own = [index for index, name in enumerate(metrics["pairs"]) if name == pair]
        cells = [sections.spread([ours[mark][index] for index in own]) for mark in TASK_MARKS]
        cells += [_pairs([row["strategy_r"][index] for index in own]) for row in (ours, supervised)]
        rows.append([pair, *cells])
    titles = [title for mark, title in COLUMNS if mark in TASK_MARKS]
    report.table(["pair", *titles, "strategy r, hop / crawl", "regression on the truth"], rows)


def _task_table(report: Report, methods: dict[str, Any]) -> None:
    rows = []
    for name, scores in methods.items():
        row = [METHODS[name].title, *(sections.spread(scores[column]) for column, _ in COLUMNS)]
        row += [f"{np.mean(scores['seconds']):.0f}", f"{np.mean(scores['env_steps']) / 1e6:.2f}"]
        rows.append(row)
    report.table(["method", *(title for _, title in COLUMNS), "seconds", "million steps"], rows)


def _strategy_table(report: Report, methods: dict[str, Any]) -> None:
    rows = []
    for name, scores in methods.items():
        if scores["strategy_r"][0] is None:
            continue
        cells = [_pairs(scores[mark]) for mark, _ in STRATEGY_COLUMNS]
        rows.append([METHODS[name].title, *cells, f"{np.mean(scores['diagonal']):.1f} of 2"])
    report.table(["method", *(title for _, title in STRATEGY_COLUMNS), "diagonal"], rows)


def _other_truths(report: Report, populations: dict[str, Any]) -> None:
    for pair, population in populations.items():
        report.heading(f"Another truth: {pair.replace('_', '-')} demonstrators")
        diagonal = np.mean(population["methods"]["oracle"]["truth_diagonal"])
        report.paragraph(
            f"{len(population['seeds'])} run(s) on a hop and a crawl trained to differ in what they do, not "
            "in where they are. Nothing was tuned on them. By their own true preferences "
            f"{diagonal:.1f} of 2 score highest on their own trajectories without noise."
        )
        _task_table(report, population["methods"])
        _strategy_table(report, population["methods"])


def _pairs(values: list[list[float]]) -> str:
    table = np.array(values, float)
    deviation = table.std(axis=0, ddof=1) if len(table) > 1 else np.zeros(2)
    return " / ".join(f"{mean:.3f} ± {d:.3f}" for mean, d in zip(table.mean(axis=0), deviation, strict=True))


def _draw(report: Report, plan: StudyPlan, folder: Path) -> None:
    runs = plan.runs(plan.pairs[0], folder / "runs")
    report.heading("Figures")
    test = runs.test_set(0)
    estimates = {
        METHODS[method].title: runs.estimate(method, 0) for method in ("msrd", "msrd_as_printed", "airl")
    }
    report.figure(
        figures.correlation_figure(estimates, test),
        "Estimated against true task reward over noise-injected trajectories, each strategy scaled to "
        "[0, 1]; first pair, first seed.",
    )
    report.figure(
        strategy_strips(runs.estimate("msrd", 0), test.clean),
        "Both strategy rewards of MSRD along a hop and along a crawl, smoothed over 0.2 s, under film strips "
        "of the demonstrators; first pair, first seed.",
    )


def _transfer(report: Report, transfer: dict[str, Any]) -> None:
    if not transfer:
        return
    report.heading("Fresh policies on frozen rewards, 20 % more mass and half the friction")
    report.paragraph(
        "Policies trained from scratch on inferred rewards (first seed of the first pairs, one standard "
        "deviation below the mean of the runs averaged, so that nothing is gained where they disagree) and "
        "on the true reward, with the same budget, beside policies moved over unchanged. Preference: mean "
        "log q of hop and crawl, at least -5."
    )
    means = {
        name: np.mean([table[name]["speed"] for table in transfer.values()]) for name in ("true reward", "R0")
    }
    report.paragraph(
        f"On R0 alone {means['R0']:.2f} m/s, on the true reward {means['true reward']:.2f} m/s: "
        f"{100 * means['R0'] / means['true reward']:.0f} %."
    )
    for pair, table in transfer.items():
        rows = []
        for name, marks in table.items():
            liking = f"{np.mean(marks['preference_hop']):.1f} / {np.mean(marks['preference_crawl']):.1f}"
            cells = [f"{speed:.2f}" for speed in marks["speed"]]
            heights = [f"{height:.2f}" for height in marks["height"]]
            rows.append([name, ", ".join(cells), ", ".join(heights), liking])
        report.table(["policy", "speeds (m/s)", "heights (m)", "preference"], rows, f"The {pair} pair.")


def _conditions(report: Report, metrics: dict[str, Any]) -> None:
    report.heading("Demonstrators and conditions")
    rows = []
    for pair, made in metrics["demonstrators"].items():
        for index, label in enumerate(LABELS):
            speed = f"{made['speed'][index]:.2f} ± {made['speed_sd'][index]:.2f}"
            rows.append([pair, label, speed, f"{made['height'][index]:.2f}", made["candidates"]])
    report.table(["pair", "gait", "speed (m/s)", "torso height (m)", "chosen among"], rows)
    report.paragraph(
        "Trained by DIAYN + speed with TRPO; the strategies of which hops are chosen also got a bonus for "
        "staying healthy while they trained. The gaits that nobody demonstrates are the other candidates."
    )
    report.code("python -m msrd_ros reproduce hopper")
