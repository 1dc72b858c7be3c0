"""The study's report: ours beside the paper's, with every rival in the same table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.reports.page import Report
from msrd_ros.reports.stroke_figures import spin_histograms
from msrd_ros.studies.table_tennis import figures
from msrd_ros.studies.table_tennis.methods import METHODS
from msrd_ros.studies.table_tennis.results import pooled
from msrd_ros.studies.table_tennis.tables import (
    methods_table,
    misses,
    overall,
    robustness_table,
    share,
    worst_text,
    write_tables,
)
from msrd_ros.table_tennis.simulation.changes import CHANGES
from msrd_ros.table_tennis.strategies.table import Strategies


def write_report(metrics: dict[str, Any], folder: Path) -> Path:
    """Write ``report.html``, and its tables as ``tables.md``, into `folder`; returns the report's path."""
    write_tables(metrics, folder)
    report = Report(
        "Table tennis",
        "Six strokes, shown by hand and recorded, learned with Multi-Strategy Reward Distillation: does the "
        "robot return the ball with the right stroke, and do the rewards say what they should?",
    )
    _beside_the_paper(report, metrics)
    _rates(report, metrics)
    _per_label(report, metrics)
    report.heading("Learning")
    report.figure(
        figures.training_curves(metrics),
        "Struck and returned balls over training time, mean policies in the batched simulator (evaluations "
        "not counted as training), first seed; the first point is cloning. The rates in the tables are "
        "played in Bullet.",
    )
    _rewards(report, metrics)
    report.heading("Spin")
    report.figure(
        spin_histograms(
            metrics["methods"]["msrd"]["spins"],
            [Strategies.shipped().of(StrategyLabel.parse(text)) for text in metrics["labels"]],
            Strategies.shipped().spin_borders,
        ),
        "Spin about the horizontal axis across the table right after the hit, returned balls of MSRD; "
        "positive is topspin. Dotted: borders between the three classes.",
    )
    _films(report, metrics, folder)
    _robustness(report, metrics)
    _over_topics(report, metrics)
    _conditions(report, metrics)
    path = folder / "report.html"
    report.write(path)
    return path


def _beside_the_paper(report: Report, metrics: dict[str, Any]) -> None:
    msrd = metrics["methods"]["msrd"]
    undone = msrd["undone"]
    real, without = np.array(undone["real"]), np.array(undone["undone"])
    topspin = [row for label, row in msrd["labels"].items() if label.endswith("topspin")]
    back = pooled([n for row in topspin for n in row["returned"]], [n for row in topspin for n in row["fed"]])
    rows = len(metrics["labels"])
    lines = [
        ["balls struck", "83 %", share(overall(msrd, "struck", "fed")), worst_text(msrd, "struck")],
        ["balls returned", "-", share(overall(msrd, "returned", "fed")), worst_text(msrd, "returned")],
        ["topspin returned", "90 %", share(back), ""],
        [
            "returned balls with the asked stroke's spin",
            "in pictures",
            share(overall(msrd, "spin_class_right", "returned")),
            worst_text(msrd, "spin_class_right"),
        ],
        [
            "returned balls within 20 cm of where the demonstrations land",
            "-",
            share(overall(msrd, "within_20cm", "returned")),
            worst_text(msrd, "within_20cm"),
        ],
        [
            f"matrix rows won by the diagonal, of {rows}, by seed",
            "all",
            ", ".join(map(str, msrd["diagonal"])),
            "held-out subjects",
        ],
        [
            "task reward a step, stroke against return undone",
            "1.476 ± 0.051 and 1.284 ± 0.042, p < .05",
            f"{real.mean():.3f} ± {real.std():.3f} and {without.mean():.3f} ± {without.std():.3f}, "
            f"p = {undone['friedman_p']:.1e}",
            f"{100 * np.mean(undone['share_in_order']):.1f} % of pairs in order",
        ],
        [
            "training time, all six strokes",
            "30 min a stroke, on the robot",
            f"{max(msrd['training_seconds']) / 60:.1f} min ({max(msrd['training_cpu_seconds']) / 60:.1f} "
            f"min of computing)",
            "longest seed",
        ],
    ]
    report.heading("Beside the paper")
    report.table(
        ["", "paper, one real robot", "here, in Bullet", "worst label"],
        lines,
        "Percent with Wilson 95 % intervals over all labels and seeds. The paper's figures are of a real arm "
        "and people; ours are of a simulated arm and synthetic teachers, and so are easier to reach.",
    )


def _rates(report: Report, metrics: dict[str, Any]) -> None:
    methods = metrics["methods"]
    report.heading("All methods")
    report.table(*methods_table(metrics))
    cloned = methods.get("behaviour_cloning")
    if cloned and misses(cloned):
        ratio = misses(methods["msrd"]) / misses(cloned)
        report.paragraph(f"MSRD misses {100 * ratio:.0f} % as many balls as plain behaviour cloning does.")
    report.paragraph(
        "MSRD, AIRL and AIRL per strategy start from cloning with corrective noise, the frozen rewards from "
        "plain cloning: what rewards and practice add is the difference to these rows. Cloning with "
        "corrective noise needs no reward at all: joint offsets are injected, with labels that undo them; "
        "where it comes level with MSRD, the return rate alone is no case for inverse reinforcement "
        "learning. What MSRD has besides is the decomposition: one task reward for all strokes, told apart "
        "from how each is played, which can train other policies (frozen R0 + S_i). AIRL with one reward "
        "plays one policy per label on the same reward, for one policy could not know which stroke is "
        "asked for."
    )


def _per_label(report: Report, metrics: dict[str, Any]) -> None:
    methods = metrics["methods"]
    labels = metrics["labels"]
    report.heading("Returned, by strategy")
    report.table(
        ["method", *labels],
        [
            [METHODS[name].title, *(share(method["labels"][label]["pooled"]["returned"]) for label in labels)]
            for name, method in methods.items()
        ],
        "Percent, all seeds together.",
    )
    msrd = methods["msrd"]["labels"]
    report.table(
        ["MSRD", "struck, by seed", "returned, by seed", "fed", "within 20 cm, %", "spin, rad/s", "misses"],
        [
            [
                label,
                ", ".join(map(str, row["struck"])),
                ", ".join(map(str, row["returned"])),
                ", ".join(map(str, row["fed"])),
                share(row["pooled"]["within_20cm"]),
                ", ".join(
                    "-" if mean is None else f"{mean:+.0f} ± {sd:.0f}"
                    for mean, sd in zip(row["spin_mean"], row["spin_sd"], strict=True)
                ),
                "; ".join(
                    f"{reason.replace('_', ' ')} {count}"
                    for reasons in row["miss_reasons"]
                    for reason, count in reasons.items()
                )
                or "none",
            ]
            for label, row in msrd.items()
        ],
    )


def _rewards(report: Report, metrics: dict[str, Any]) -> None:
    methods = metrics["methods"]
    report.heading("What the rewards say of subjects who were kept from training")
    rows = []
    for name, method in methods.items():
        undone = method["undone"]
        if undone is None:
            continue
        diagonal = "-"
        if method["diagonal"][0] is not None:
            diagonal = f"{', '.join(map(str, method['diagonal']))} of {len(method['matrix'][0])}"
        rows.append(
            [
                METHODS[name].title,
                diagonal,
                f"{np.mean(undone['real']):.3f}",
                f"{np.mean(undone['undone']):.3f}",
                f"{100 * np.mean(undone['share_in_order']):.1f} %",
                f"{undone['friedman_p']:.1e}",
            ]
        )
    report.table(
        ["method", "diagonal, by seed", "reward, real", "return undone", "in order", "Friedman p"],
        rows,
        "Return undone: the launch is fitted to what the camera saw before the hit, and the ball flown on as "
        "if untouched, seen with the same noise. MSRD: the task reward; AIRL: its only reward; AIRL per "
        "strategy: the stroke's own reward. The p is of the least convincing seed. MSRD is trained with "
        "cross-negatives (other strategies' demonstrations as further negatives), AIRL without; the same "
        "without and with them stands in the rows of the supplement, where it was run.",
    )
    report.figure(
        figures.matrices({METHODS[name].title: m for name, m in methods.items()}),
        "Strategy rewards (rows) on held-out strokes of each strategy (columns), rows scaled to [0, 1], "
        "first seed.",
    )


def _films(report: Report, metrics: dict[str, Any], folder: Path) -> None:
    from PIL import Image

    report.heading("What it looks like")
    for label in metrics["labels"]:
        path = folder / "films" / f"{label}.png"
        if path.exists():
            with Image.open(path) as image:
                report.picture(np.asarray(image.convert("RGB")), f"{label}, played by MSRD in Bullet")


def _robustness(report: Report, metrics: dict[str, Any]) -> None:
    if not metrics["robustness"]:
        return
    report.heading("Robustness")
    report.table(*robustness_table(metrics))
    report.paragraph(
        f"Nothing was trained for these conditions but {METHODS['msrd_randomised'].title!r}: 3 mm of noise "
        "and delays of up to 20 ms. Estimator: the ball's launch is fitted to all samples so far "
        "and flown to the present moment, instead of raw samples' differences."
    )
    report.table(
        ["what changes", "why by so much"],
        [[change.title, change.why] for change in CHANGES.values() if change.why],
    )


def _over_topics(report: Report, metrics: dict[str, Any]) -> None:
    if "hot_swap" not in metrics:
        return
    labels, live, curve = metrics["labels"], metrics["plan"]["live"], metrics["hot_swap"]
    report.heading("Over topics")
    report.table(
        ["rollouts from", *labels],
        [
            [name, *(f"{row[label]['returned']} of {row[label]['fed']}" for label in labels)]
            for name, row in metrics["over_topics"].items()
        ],
        f"Returned in Bullet after {live['iterations']} iterations of {live['episodes']} rollouts each: "
        "every rollout through executor and simulator nodes in lockstep, beside the batched simulator.",
    )
    report.figure(
        figures.exchange(curve),
        f"A trainer improves policies while the robot plays them: {curve[-1]['policies']} sets were "
        f"exchanged between strokes. Each point is {curve[0]['fed']} balls of the evaluator; the last one "
        "after training.",
    )


def _conditions(report: Report, metrics: dict[str, Any]) -> None:
    plan, subjects = metrics["plan"], metrics["subjects"]
    limits = [one for method in metrics["methods"].values() for one in method["limits"]]
    report.heading("Conditions")
    report.paragraph(
        f"Trained on {len(subjects['training'])} subjects ({', '.join(subjects['training'])}), rewards "
        f"judged on {', '.join(subjects['held_out'])}. {plan['balls']} balls per label and training seed, "
        f"standard spread, start postures scattered by 0.03 rad; seeds {metrics['seeds']}. Training: "
        f"{plan['budget']['iterations']} iterations, {plan['budget']['plain_iterations']} from plain "
        f"cloning, of {plan['budget']['episodes']} rollouts a strategy in the batched simulator."
    )
    report.paragraph(
        f"Over all evaluation balls of all methods, {sum(one['samples'] for one in limits) / 1000:.0f} s of "
        f"motion, a joint limit was exceeded in {sum(one['exceeded'] for one in limits)} ms; the largest "
        f"speed was {100 * max(one['speed_fraction'] for one in limits):.1f} % and the largest torque "
        f"{100 * max(one['torque_fraction'] for one in limits):.1f} % of its limit."
    )
    report.code(f"python -m msrd_ros reproduce table_tennis --seeds {len(metrics['seeds'])}")
