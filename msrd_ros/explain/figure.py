"""The picture of explained strokes: paths coloured by R0, S_i over time, and whose stroke it is."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.explain.explanation import UNCALIBRATED, Explanation
from msrd_ros.explain.panels import (
    INK,
    WIDTH_IN,
    draw_bars,
    draw_curves,
    draw_paths,
    draw_side_view,
    draw_top_view,
)
from msrd_ros.table_tennis.strategies.table import Strategies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_STROKES = 2
FORMATS = ("png", "svg")

_HEIGHT_IN, _DPI = 8.0, 100
_RIGHT, _GAP = 0.91, 0.075
"""Where panels end and how far those of two strokes are apart, as shares of the width."""


class _Panels(NamedTuple):
    """Where a stroke is drawn."""

    side: Axes
    top: Axes
    curves: Axes
    bars: Axes


def write_figure(
    path: Path,
    strokes: Sequence[Explanation],
    titles: Sequence[str],
    strategies: Strategies,
    temperature: float = UNCALIBRATED,
) -> None:
    """Draw one or two strokes, 1280 pixels wide and 800 high, whole or not at all.

    Parameters
    ----------
    path
        Its suffix says the format: `FORMATS`.
    strokes, titles
        What is drawn side by side, with the same scales, and what stands above each.
    strategies
        Their colours.
    temperature
        Of the posterior, see `Explanation.posterior`.

    Raises
    ------
    UserError
        If the format is another one, there are too many strokes, or it cannot be written.
    """
    kind = require_format(path)
    if not 1 <= len(strokes) <= MOST_STROKES:
        raise UserError(f"{path}: {len(strokes)} strokes; draw one, or two beside each other")
    write_atomically(path, render(kind, strokes, titles, strategies, temperature))


def render(
    kind: str,
    strokes: Sequence[Explanation],
    titles: Sequence[str],
    strategies: Strategies,
    temperature: float = UNCALIBRATED,
) -> bytes:
    """The figure of `write_figure` as a file of one of `FORMATS` holds it."""
    import matplotlib

    buffer = io.BytesIO()
    # The same strokes give the same bytes, and text stays text.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "msrd_ros", "font.size": 9}):
        figure = draw(strokes, titles, strategies, temperature)
        figure.savefig(buffer, format=kind, metadata={"Date": None} if kind == "svg" else None)
    return buffer.getvalue()


def require_format(path: Path) -> str:
    """The format that a file's name asks for.

    Raises
    ------
    UserError
        If it is none of `FORMATS`.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise UserError(f"{path}: no picture of this kind; call it .svg or .png")
    return kind


def draw(
    strokes: Sequence[Explanation],
    titles: Sequence[str],
    strategies: Strategies,
    temperature: float = UNCALIBRATED,
) -> Figure:
    """The figure of `write_figure`."""
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, _HEIGHT_IN), dpi=_DPI)
    task = np.concatenate([stroke.task for stroke in strokes])
    norm = Normalize(float(task.min()), float(task.max()))
    every = np.concatenate([stroke.strategy for stroke in strokes])
    margin = 0.05 * float(np.ptp(every)) or 1.0
    reach = float(every.min()) - margin, float(every.max()) + margin
    highest = max(1.45, *(float(np.max([s.ball[:, 2], s.paddle[:, 2]])) + 0.05 for s in strokes))
    known = [strategies.of(StrategyLabel.parse(label, "strategy")) for label in strokes[0].labels]
    for stroke, panels in zip(strokes, _places(figure, titles), strict=True):
        line = draw_paths(panels.side, stroke, 2, norm)
        draw_side_view(panels.side, highest)
        draw_paths(panels.top, stroke, 1, norm)
        draw_top_view(panels.top)
        draw_curves(panels.curves, stroke, known, reach)
        draw_bars(panels.bars, stroke, known, temperature)
    scale = figure.add_axes((_RIGHT + 0.018, 0.56, 0.012, 0.34))
    figure.colorbar(line, cax=scale, label="task reward $R_0$ of a step (no unit)")
    return figure


def _places(figure: Figure, titles: Sequence[str]) -> list[_Panels]:
    """Panels of every stroke: two views beside each other for one, above each other for two."""
    if len(titles) == 1:
        figure.text(0.055, 0.955, titles[0], fontsize=12, fontweight="bold", color=INK)
        views = figure.add_gridspec(1, 2, left=0.055, right=_RIGHT, top=0.9, bottom=0.6, wspace=0.15)
        below = figure.add_gridspec(
            1, 2, left=0.055, right=_RIGHT, top=0.5, bottom=0.075, width_ratios=(1.7, 1.0), wspace=0.46
        )
        return [_Panels(*(figure.add_subplot(grid[column]) for grid in (views, below) for column in (0, 1)))]
    width = (_RIGHT - 0.055 - _GAP) / len(titles)
    found = []
    for number, title in enumerate(titles):
        left = 0.055 + number * (width + _GAP)
        figure.text(left, 0.96, title, fontsize=10, fontweight="bold", color=INK)
        views = figure.add_gridspec(
            2,
            1,
            left=left,
            right=left + width,
            top=0.915,
            bottom=0.37,
            height_ratios=(1.0, 1.85),
            hspace=0.22,
        )
        below = figure.add_gridspec(
            1,
            2,
            left=left,
            right=left + width,
            top=0.29,
            bottom=0.07,
            width_ratios=(1.45, 1.0),
            wspace=1.05,
        )
        found.append(
            _Panels(
                figure.add_subplot(views[0]),
                figure.add_subplot(views[1]),
                figure.add_subplot(below[0]),
                figure.add_subplot(below[1]),
            )
        )
    return found
