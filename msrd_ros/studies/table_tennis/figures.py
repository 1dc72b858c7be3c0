"""Figures of the table tennis report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.reports.stroke_figures import SIDE_LINES, draw_matrix
from msrd_ros.table_tennis.strategies.table import Strategies

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def training_curves(metrics: dict[str, Any]) -> Figure:
    """Struck and returned shares over seconds of training, MSRD above and frozen rewards below."""
    import matplotlib.pyplot as plt

    names = [
        name
        for name in ("msrd", "frozen_reward")
        if len(metrics["methods"].get(name, {}).get("curves", [[]])[0]) > 1
    ]
    titles = {
        "msrd": "MSRD",
        "frozen_reward": "frozen R0 + S_i",
    }
    figure, panels = plt.subplots(
        max(len(names), 1), 2, figsize=(11, 3.0 * max(len(names), 1)), sharey=True, squeeze=False
    )
    for row, name in zip(panels, names, strict=False):
        curve = metrics["methods"][name]["curves"][0]
        minutes = [point["seconds"] / 60 for point in curve]
        for axes, kind in zip(row, ("struck", "returned"), strict=True):
            for index, text in enumerate(metrics["labels"]):
                strategy = Strategies.shipped().of(StrategyLabel.parse(text))
                axes.plot(
                    minutes,
                    [100 * point[kind][index] for point in curve],
                    SIDE_LINES[strategy.side],
                    color=strategy.colour,
                    label=text,
                )
            axes.set_title(f"{titles[name]}: {kind}")
            axes.set_xlabel("minutes of training")
            axes.set_ylim(0, 103)
            axes.grid(alpha=0.3)
        row[0].set_ylabel("balls, %")
    panels[0][1].legend(fontsize=7, ncols=2, loc="lower right")
    figure.tight_layout()
    return figure


def exchange(curve: list[dict[str, Any]]) -> Figure:
    """Returned shares while the policies were being exchanged."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 3.2))
    seconds = [point["seconds"] for point in curve]
    for name, marker in (("struck", "^"), ("returned", "o")):
        shares = [100 * point[name] / point["fed"] for point in curve]
        axes.plot(seconds, shares, marker=marker, label=name)
    axes.set_xlabel("seconds since the first policies were in force")
    axes.set_ylabel("balls, %")
    axes.set_ylim(0, 103)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.tight_layout()
    return figure


def matrices(methods: dict[str, Any]) -> Figure:
    """Strategy matrices of the first seed, of every method that has one."""
    import matplotlib.pyplot as plt

    shown = {name: np.array(m["matrix"][0]) for name, m in methods.items() if m["matrix"][0] is not None}
    figure, panels = plt.subplots(1, len(shown), figsize=(4.6 * len(shown), 4.4), squeeze=False)
    for axes, (name, matrix) in zip(panels[0], shown.items(), strict=True):
        draw_matrix(axes, matrix, fontsize=7)
        names = methods[name]["strategy_rewards"]
        axes.set_xticks(range(len(names)), names, rotation=40, ha="right", fontsize=7)
        axes.set_yticks(range(len(names)), names, fontsize=7)
        axes.set_title(name, fontsize=9)
    figure.tight_layout()
    return figure
