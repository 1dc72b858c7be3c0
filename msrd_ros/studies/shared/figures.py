"""The paper's figures redrawn from our data, readable in print and in grey."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.evaluation import TestSet, mean_over, normalised

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DARK, LIGHT = "#1c2430", "#9aa7b5"


def new_figure(columns: int, width: float = 4.6, height: float = 3.4) -> tuple[Figure, Any]:
    """A row of plain axes."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, columns, figsize=(width * columns, height), squeeze=False)
    for axis in axes[0]:
        axis.spines[["top", "right"]].set_visible(False)
    figure.subplots_adjust(wspace=0.32)
    return figure, axes[0]


def correlation_figure(estimates: dict[str, Estimate], test: TestSet) -> Figure:
    """Estimated against true task reward, each normalised per strategy (paper, Figure 2)."""
    figure, axes = new_figure(len(estimates))
    truth = normalised(test.task_truth)
    fallen = test.fallen
    for axis, (name, estimate) in zip(axes, estimates.items(), strict=True):
        assert estimate.task is not None
        found = normalised(mean_over(estimate.task, test.noisy))
        r = float(np.corrcoef(found.ravel(), truth.ravel())[0, 1])
        axis.scatter(
            truth[~fallen], found[~fallen], s=14, marker="o", color=DARK, label="stays up", alpha=0.6
        )
        axis.scatter(
            truth[fallen], found[fallen], s=14, marker="x", color="#b3202a", label="falls", alpha=0.6
        )
        axis.set(xlabel="true task reward", ylabel="estimated", title=f"{name}: r = {r:.3f}")
    axes[0].legend(frameon=False, fontsize=9)
    return figure


def strategy_bars(scores: dict[str, list[float]]) -> Figure:
    """Correlation of each strategy-only reward with the true preference (paper, Figure 3)."""
    figure, (axis,) = new_figure(1, 9.5, 3.4)
    shades = np.linspace(0.1, 0.75, len(scores))
    hatches = ("", "//", "..", "xx")
    width = 0.8 / len(scores)
    for index, (name, values) in enumerate(scores.items()):
        places = np.arange(len(values)) + (index - (len(scores) - 1) / 2.0) * width
        label = f"{name} (mean {np.mean(values):.2f})"
        axis.bar(places, values, width, color=str(shades[index]), hatch=hatches[index % 4], label=label)
    count = len(next(iter(scores.values())))
    axis.set(xlabel="strategy", ylabel="correlation with the true preference", xticks=np.arange(count))
    axis.set_xticklabels([str(number + 1) for number in range(count)], fontsize=8)
    axis.axhline(0.0, color=DARK, lw=0.8)
    axis.legend(frameon=False, fontsize=9, ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return figure


def heatmap(matrices: dict[str, NDArray[np.float64]]) -> Figure:
    """Each strategy reward on each strategy's trajectories, rows normalised to [0, 1] (paper, Figure 5)."""
    figure, axes = new_figure(len(matrices), 4.4, 4.0)
    for axis, (name, matrix) in zip(axes, matrices.items(), strict=True):
        _draw_matrix(axis, normalised(matrix), name)
    return figure


def _draw_matrix(axis: Axes, values: NDArray[np.float64], name: str) -> None:
    count = values.shape[0]
    best = values.argmax(axis=1)
    axis.imshow(values, cmap="Greys", vmin=0.0, vmax=1.0)
    for row in range(count):
        hit = best[row] == row
        axis.plot(best[row], row, "o" if hit else "x", color="white", ms=4, mec="white" if hit else "#ff5a4f")
    axis.set(xlabel="trajectories of strategy", ylabel="reward of strategy")
    ticks = np.arange(0, count, max(1, count // 5))
    axis.set_xticks(ticks, [str(tick + 1) for tick in ticks])
    axis.set_yticks(ticks, [str(tick + 1) for tick in ticks])
    axis.set_title(f"{name}: {int((best == np.arange(count)).sum())} of {count} on the diagonal", fontsize=10)
