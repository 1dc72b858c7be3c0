"""What the pictures of strokes have in common: colours by stroke, marks by side, spins, matrix cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import Side, StrategyLabel, Stroke
from msrd_ros.table_tennis.strokes.rates import SPIN_CLASS_BORDER_RAD_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours: told apart by the colour-blind, and different in grey.
STROKE_COLOURS = {Stroke.PUSH: "#0072B2", Stroke.SLICE: "#E69F00", Stroke.TOPSPIN: "#7a1f5c"}
SIDE_LINES = {Side.FOREHAND: "-", Side.BACKHAND: "--"}
SIDE_MARKERS = {Side.FOREHAND: "o", Side.BACKHAND: "^"}
STROKE_HATCHES = {Stroke.PUSH: "", Stroke.SLICE: "///", Stroke.TOPSPIN: "..."}


def spin_histograms(spins: Mapping[str, Sequence[float]], labels: Sequence[StrategyLabel]) -> Figure:
    """Spin about y of returned balls by label, rad/s; one panel a side, borders of the classes dotted."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 3.0), sharey=True, sharex=True)
    bins = np.arange(-200, 201, 10)
    for axes, side in zip(panels, Side, strict=True):
        for label in labels:
            if label.side is side:
                axes.hist(
                    spins[str(label)],
                    bins=bins,
                    color=STROKE_COLOURS[label.stroke],
                    alpha=0.75,
                    label=label.stroke.value,
                    hatch=STROKE_HATCHES[label.stroke],
                    edgecolor="white",
                )
        for border in (-SPIN_CLASS_BORDER_RAD_S, SPIN_CLASS_BORDER_RAD_S):
            axes.axvline(border, color="#333", linestyle=":", linewidth=1)
        axes.set_title(side.value)
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
