"""What the pictures of strokes have in common: lines and marks by side, spins, matrix cells."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from msrd_ros.table_tennis.strategies.table import Side, Strategy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIDE_LINES: dict[Side | None, str] = dict(zip((*Side, None), ("-", "--", ":"), strict=True))
SIDE_MARKERS: dict[Side | None, str] = dict(zip((*Side, None), ("o", "^", "s"), strict=True))
"""None stands for a side that no table tells."""
HATCHES = ("", "///", "...", "xxx", "ooo")


def by_side(strategies: Sequence[Strategy]) -> dict[str, list[Strategy]]:
    """Strategies by the title of their panel: the sides, and one for those without if there are any."""
    panels = {side.value: [each for each in strategies if each.side is side] for side in Side}
    others = [each for each in strategies if each.side is None]
    return {**panels, "side not listed": others} if others else panels


def spin_histograms(
    spins: Mapping[str, Sequence[float]], strategies: Sequence[Strategy], borders: Sequence[float]
) -> Figure:
    """Spin about y of returned balls by label, rad/s; one panel a side, borders of the classes dotted."""
    import matplotlib.pyplot as plt

    grouped = by_side(strategies)
    figure, panels = plt.subplots(1, len(grouped), figsize=(11, 3.0), sharey=True, sharex=True)
    bins = np.arange(-200, 201, 10)
    for axes, (title, group) in zip(panels, grouped.items(), strict=True):
        for strategy, hatch in zip(group, itertools.cycle(HATCHES), strict=False):
            axes.hist(
                spins[str(strategy.label)],
                bins=bins,
                color=strategy.colour,
                alpha=0.75,
                label=strategy.stroke,
                hatch=hatch,
                edgecolor="white",
            )
        for border in borders:
            axes.axvline(border, color="#333", linestyle=":", linewidth=1)
        axes.set_title(title)
        axes.set_xlabel("spin, rad/s")
        axes.legend(fontsize=8)
    panels[0].set_ylabel("balls")
    return figure


def draw_matrix(axes: Axes, matrix: NDArray[np.float64], fontsize: float) -> None:
    """Cells of a strategy matrix in [0, 1], shape (S, S), with their numbers; each row's best in bold."""
    axes.imshow(matrix, cmap="cividis", vmin=0, vmax=1)
    for row, values in enumerate(matrix):
        best = int(values.argmax())
        for column, value in enumerate(values):
            axes.text(
                column,
                row,
                f"{value:.2f}",
                ha="center",
                va="center",
                fontsize=fontsize,
                fontweight="bold" if column == best else "normal",
                color="white" if value < 0.6 else "black",
            )
