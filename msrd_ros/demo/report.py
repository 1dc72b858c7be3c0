"""The demo's report: what was taught, what was learned, how it plays, in one HTML file."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.reports.film import film_of
from msrd_ros.reports.page import Report
from msrd_ros.reports.stroke_figures import (
    SIDE_LINES,
    SIDE_MARKERS,
    by_side,
    draw_matrix,
    spin_histograms,
)
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.strategies.table import Strategies, Strategy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def write_report(out: Path, metrics: dict[str, Any], robot: Robot) -> None:
    """Write ``out/report.html`` from what the demo left in `out`.

    Parameters
    ----------
    out
        The demo's folder.
    metrics
        Content of its ``metrics.json``.
    robot
        The arm that played.
    """
    training = read_report(out / "training" / "training.json")
    evaluation = read_report(out / "evaluation.json")
    table = Strategies.shipped()
    strategies = [table.of(StrategyLabel.parse(text)) for text in training["labels"]]
    rows, seconds = metrics["labels"], metrics["seconds"]
    taught = sum(row["demonstrations"] for row in rows.values())
    fed = sum(row["fed"] for row in rows.values())
    report = Report(
        "Six strokes, taught by hand",
        f"{metrics['subjects']} teachers led the arm {robot.name} by the hand through push, slice and "
        f"topspin, forehand and backhand. The {taught} recorded strokes were replayed into Multi-Strategy "
        f"Reward Distillation, and what it learned was played against {fed} new balls. Every hop went over "
        f"ROS 2 topics between processes.",
    )
    report.numbers(
        [
            (f"{_share(rows, 'returned'):.0%}", "of all balls returned"),
            (f"{_share(rows, 'struck'):.0%}", "of all balls struck"),
            (f"{_spin_share(rows):.0%}", "returned with the asked stroke's spin"),
            (str(metrics["limits_exceeded"]), "times over a joint limit"),
            (f"{seconds['total'] / 60:.1f} min", "from the first stroke to this page"),
        ]
    )
    _write_rates(report, rows)
    _write_films(report, out, robot, [strategy.label for strategy in strategies])
    report.heading("Where the returned balls landed, and how they spun")
    report.figure(
        _landing_map(evaluation["labels"], strategies),
        "Seen from above, the robot on the left. Every returned ball's first bounce on the far half; a line "
        "leads there from the target that its stroke was told.",
    )
    report.figure(
        spin_histograms(
            {label: row["spins"] for label, row in evaluation["labels"].items()},
            strategies,
            table.spin_borders,
        ),
        "Spin about the horizontal axis across the table just after the hit, returned balls; positive is "
        "topspin. Dotted: the borders between the three spin classes.",
    )
    report.heading("Learning")
    report.figure(
        _training_curves(training, strategies),
        "Returned balls over training, mean policies in the batched simulator; iteration 0 is behaviour "
        "cloning. The rates in the table above are played in Bullet, over topics.",
    )
    report.figure(
        _matrix(np.array(training["strategy_matrix"]), training["strategy_rewards"]),
        "Each strategy's own reward (row) along the demonstrations of each strategy (column), rows scaled to "
        "[0, 1]. The diagonal should be the highest of its row.",
    )
    _write_how(report, out, metrics)
    report.write(out / "report.html")


def _share(rows: dict[str, Any], name: str) -> float:
    count: int = sum(row[name] for row in rows.values())
    fed: int = sum(row["fed"] for row in rows.values())
    return count / max(fed, 1)


def _spin_share(rows: dict[str, Any]) -> float:
    judged = [row for row in rows.values() if row["spin_class_right"] is not None]
    returned: int = sum(row["returned"] for row in judged)
    right: int = sum(row["spin_class_right"] for row in judged)
    return right / max(returned, 1)


def _interval(row: dict[str, Any], name: str) -> str:
    share = row[f"{name}_share"]
    if share is None:
        return "-"
    low, high = row[f"{name}_interval"]
    return f"{share:.0%} ({low:.0%} to {high:.0%})"


def _write_rates(report: Report, rows: dict[str, Any]) -> None:
    report.heading("How it plays")
    report.table(
        [
            "strategy",
            "taught",
            "fed",
            "struck",
            "returned",
            "within 20 cm",
            "spin, rad/s",
            "spin class right",
        ],
        [
            [
                label,
                row["demonstrations"],
                row["fed"],
                _interval(row, "struck"),
                _interval(row, "returned"),
                _interval(row, "within_20cm"),
                "-" if row["spin_mean"] is None else f"{row['spin_mean']:+.0f} ± {row['spin_sd']:.0f}",
                _interval(row, "spin_class_right"),
            ]
            for label, row in rows.items()
        ],
        "Shares with Wilson 95 % intervals. Within 20 cm: of the target that each stroke was told, drawn "
        "from all in its reach; of returned balls. Feeds vary by ±3 % in speed, ±1.5° in elevation and yaw, "
        "±20 rad/s in spin and ±2 cm sideways; the arm starts within 0.03 rad (standard deviation) of its "
        "ready pose.",
    )
    report.table(
        ["strategy", "what it does"],
        [[label, row["description"]["text"]] for label, row in rows.items()],
        "Of returned balls: side, spin and speed right after the hit, and the first bounce on the far half; "
        "mean and standard deviation, left as the robot sees it.",
    )
    missed = {label: row["miss_reasons"] for label, row in rows.items() if row["miss_reasons"]}
    if missed:
        told = "; ".join(
            f"{label}: "
            + ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in reasons.items())
            for label, reasons in missed.items()
        )
        report.paragraph(f"Balls not returned: {told}.")


def played_strokes(folder: Path, robot: Robot) -> dict[StrategyLabel, Episode]:
    """One recorded stroke per label, one that the recorder accepted where there is one."""
    chosen: dict[StrategyLabel, Episode] = {}
    library = BagLibrary.scan(folder)
    for info in sorted(library.bags, key=lambda bag: not bag.kept):
        # A stroke that was kept although it was refused may not be whole; the page does without it.
        with suppress(UserError):
            for episode in read_episodes(Bag(info.path), robot):
                chosen.setdefault(episode.strategy, episode)
    return chosen


def _write_films(report: Report, out: Path, robot: Robot, labels: list[StrategyLabel]) -> None:
    report.heading("What it looks like")
    strokes = played_strokes(out / "played", robot)
    for label in labels:
        if label in strokes:
            report.picture(film_of(strokes[label]), f"{label}: {_describe(strokes[label])}")


def _describe(episode: Episode) -> str:
    outcome = episode.outcome
    if outcome is None or not outcome.struck:
        return "the ball went past"
    speed = np.linalg.norm([outcome.velocity_x_m_s, outcome.velocity_y_m_s, outcome.velocity_z_m_s])
    return f"{outcome.message}, {speed:.1f} m/s and {outcome.spin_y_rad_s:+.0f} rad/s of spin after the hit"


def _draw_table(axes: Axes) -> None:
    from matplotlib.patches import Rectangle

    table = Scene().table
    half_length, half_width = table.length_m / 2, table.width_m / 2
    axes.add_patch(
        Rectangle(
            (-half_length, -half_width), table.length_m, table.width_m, facecolor="#e8eef4", edgecolor="#556"
        )
    )
    axes.plot([0, 0], [-half_width - 0.15, half_width + 0.15], color="#333", linewidth=2)
    axes.plot([-half_length, half_length], [0, 0], color="white", linewidth=1)
    axes.set_xlim(-half_length - 0.1, half_length + 0.1)
    axes.set_ylim(-half_width - 0.15, half_width + 0.15)
    axes.set_aspect("equal")


def _landing_map(rates: dict[str, Any], strategies: list[Strategy]) -> Figure:
    import matplotlib.pyplot as plt

    grouped = by_side(strategies)
    figure, panels = plt.subplots(1, len(grouped), figsize=(11, 3.6), sharey=True)
    for axes, (title, group) in zip(panels, grouped.items(), strict=True):
        _draw_table(axes)
        for strategy in group:
            row = rates[str(strategy.label)]
            points, targets = (np.array(row[name]).reshape(-1, 2) for name in ("landing_points", "targets"))
            axes.plot(*np.stack([targets, points]).T.swapaxes(1, 2), color=strategy.colour, linewidth=0.5)
            axes.scatter(
                points[:, 0],
                points[:, 1],
                s=16,
                color=strategy.colour,
                marker=SIDE_MARKERS[strategy.side],
                alpha=0.7,
                label=strategy.stroke,
                linewidths=0,
            )
        axes.set_title(title)
        axes.set_xlabel("x, m")
        axes.legend(loc="lower left", fontsize=8, framealpha=0.9)
    panels[0].set_ylabel("y, m")
    return figure


def _training_curves(training: dict[str, Any], strategies: list[Strategy]) -> Figure:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8.5, 3.6))
    iterations = [point["iteration"] for point in training["curve"]]
    for index, strategy in enumerate(strategies):
        axes.plot(
            iterations,
            [100 * point["returned"][index] for point in training["curve"]],
            SIDE_LINES[strategy.side],
            color=strategy.colour,
            marker=SIDE_MARKERS[strategy.side],
            markersize=4,
            label=str(strategy.label),
        )
    axes.set_xlabel("iterations over all strategies")
    axes.set_ylabel("returned, %")
    axes.set_ylim(0, 102)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, ncols=2, loc="lower right")
    return figure


def _matrix(matrix: NDArray[np.float64], names: list[str]) -> Figure:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 5.0))
    draw_matrix(axes, matrix, fontsize=8)
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set_xlabel("demonstrations of")
    axes.set_ylabel("reward of")
    figure.colorbar(axes.images[0], shrink=0.8)
    return figure


def _write_how(report: Report, out: Path, metrics: dict[str, Any]) -> None:
    seconds, recorded = metrics["seconds"], metrics["recorded"]
    report.heading("How it was made")
    rejected = {key.removeprefix("rejected_"): value for key, value in recorded.items() if "rejected_" in key}
    told = ", ".join(f"{value} {key.replace('_', ' ')}" for key, value in rejected.items()) or "none"
    report.paragraph(
        f"Recording kept {recorded.get('kept', '?')} strokes (not kept: {told}) with "
        f"{metrics['messages_lost']} messages lost; {metrics['ticks_asked_again']} ticks of the evaluation "
        f"had to be asked again. The largest joint speed in the evaluation was "
        f"{metrics['speed_fraction_max']:.1%} of its limit, the largest torque "
        f"{metrics['torque_fraction_max']:.1%}."
    )
    report.table(
        ["stage", "seconds"],
        [[name, f"{value:.0f}"] for name, value in seconds.items()],
        f"Seed {metrics['seed']}, {metrics['iterations']} iterations. All figures are in metrics.json.",
    )
    report.paragraph("Play it yourself:")
    policies = out / "training" / "policies.safetensors"
    report.code(f"python -m msrd_ros up play checkpoint:={policies} mode:=real_time gui:=true balls:=3")
