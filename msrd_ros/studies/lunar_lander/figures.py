"""The study's figure, readable in print and in grey."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from msrd_ros.studies.shared.figures import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def returns_figure(returns: dict[str, NDArray[np.float64]]) -> Figure:
    """Mean true return of each strategy's policy ``[S]``, by method."""
    figure, (axis,) = new_figure(1, 9.5, 3.6)
    for (name, values), marker in zip(returns.items(), "ox+s^Dv*", strict=False):
        axis.plot(np.arange(1, len(values) + 1), values, marker=marker, linestyle="", label=name)
    axis.axhline(0.0, linewidth=0.6, color="black")
    axis.set(xlabel="strategy", ylabel="mean true return", xticks=np.arange(1, len(values) + 1))
    axis.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
