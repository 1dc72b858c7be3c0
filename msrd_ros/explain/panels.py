"""Panels of the picture of an explained stroke: both paths on the table, curves and bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.explain.explanation import UNCALIBRATED, Explanation
from msrd_ros.reports.stroke_figures import SIDE_LINES
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.strategies.table import Strategy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

INK, WIDTH_IN = "#1c2430", 12.8
_RED = "#b3202a"
_COLOURS = "cividis"
_PAPER: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}
_X_M, _Y_M, _LOWEST_M = (-2.15, 2.15), (-0.95, 0.95), 0.6
_MARK_STEPS = 5
_SAMPLE_IN, _SAMPLE_PAD = (-0.31, -0.05), 26
"""Where a curve's line is shown beside its bar, inches from it, and how far the name is, in points."""


def draw_paths(axes: Axes, stroke: Explanation, height: int, norm: Normalize) -> LineCollection:
    """Both paths over x and the axis `height` (1: y, 2: z), coloured by R0, and where they met."""
    plane = [0, height]
    _draw_path(axes, stroke.paddle[:, plane], stroke.task, norm, 2.5, "s")
    line = _draw_path(axes, stroke.ball[:, plane], stroke.task, norm, 5.0, "o")
    x, other = (float(np.interp(stroke.hit_s, stroke.time_s, stroke.ball[:, axis])) for axis in plane)
    axes.plot(x, other, "o", markersize=13, markerfacecolor="none", markeredgecolor=_RED, markeredgewidth=1.8)
    for name, path, offset in (("ball", stroke.ball, (-6, 9)), ("paddle", stroke.paddle, (2, -16))):
        axes.annotate(
            name,
            (float(path[0, 0]), float(path[0, height])),
            textcoords="offset points",
            xytext=offset,
            color=INK,
            bbox=_PAPER,
        )
    axes.annotate(
        _meeting(stroke),
        (x, other),
        textcoords="offset points",
        xytext=(12, 10),
        color=_RED,
        fontweight="bold",
        bbox=_PAPER,
    )
    return line


def _draw_path(
    axes: Axes,
    points: NDArray[np.float64],
    task: NDArray[np.float64],
    norm: Normalize,
    width: float,
    marker: str,
) -> LineCollection:
    """One path (T, 2) on a dark edge, so that light colours are seen as well, with marks of time."""
    from matplotlib.collections import LineCollection

    axes.plot(*points.T, color=INK, linewidth=width + 1.4, solid_capstyle="round")
    line = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)), cmap=_COLOURS, norm=norm, linewidths=width
    )
    line.set_array(task[1:])
    axes.add_collection(line)
    axes.plot(*points[::_MARK_STEPS].T, marker, color="white", markeredgecolor=INK, markersize=width)
    return line


def _meeting(stroke: Explanation) -> str:
    return "nearest" if stroke.struck is False else "hit"


def draw_side_view(axes: Axes, highest: float) -> None:
    """Frame of the view along y: table and net, heights up to `highest` in m."""
    from matplotlib.patches import Rectangle

    table, net = Scene().table, Scene().net
    corner = -table.length_m / 2, table.height_m - table.thickness_m
    axes.add_patch(
        Rectangle(corner, table.length_m, table.thickness_m, facecolor="#c9d6e4", edgecolor="#556")
    )
    axes.plot([0, 0], [table.height_m, table.height_m + net.height_m], color="#556", linewidth=2, zorder=1)
    axes.set(xlim=_X_M, ylim=(_LOWEST_M, highest), aspect="equal", anchor="N", xlabel="x, m", ylabel="z, m")
    axes.set_title(f"from the side; marks every {_MARK_STEPS * CONTROL_PERIOD_S:g} s", fontsize=9, loc="left")


def draw_top_view(axes: Axes) -> None:
    """Frame of the view from above: table and net."""
    from matplotlib.patches import Rectangle

    table, net = Scene().table, Scene().net
    corner = -table.length_m / 2, -table.width_m / 2
    axes.add_patch(
        Rectangle(corner, table.length_m, table.width_m, facecolor="#e8eef4", edgecolor="#556", zorder=0)
    )
    half = table.width_m / 2 + net.overhang_m
    axes.plot([0, 0], [-half, half], color="#556", linewidth=2, zorder=1)
    axes.set(xlim=_X_M, ylim=_Y_M, aspect="equal", anchor="N", xlabel="x, m", ylabel="y, m")
    axes.set_title("from above, the robot on the left", fontsize=9, loc="left")


def draw_curves(
    axes: Axes, stroke: Explanation, known: Sequence[Strategy], reach: tuple[float, float]
) -> None:
    """Every S_i over the time since the hit within `reach`, that of the stroke's own label bold."""
    for number, strategy in enumerate(known):
        own = strategy.label == stroke.episode.label
        axes.plot(
            stroke.time_s - stroke.hit_s,
            stroke.strategy[:, number],
            SIDE_LINES[strategy.side],
            color=strategy.colour,
            linewidth=2.6 if own else 1.3,
        )
    axes.axvline(0.0, color=_RED, linewidth=1.4)
    axes.annotate(
        _meeting(stroke),
        (0.0, 0.0),
        xycoords=axes.get_xaxis_transform(),
        textcoords="offset points",
        xytext=(3, 3),
        color=_RED,
        bbox=_PAPER,
    )
    axes.set(ylim=reach, xlabel=f"time since {_meeting(stroke)}, s", ylabel="$S_i$ of a step (no unit)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title("strategy rewards", fontsize=9, loc="left")


def draw_bars(axes: Axes, stroke: Explanation, known: Sequence[Strategy], temperature: float) -> None:
    """Shares of the posterior in the order of `known`, each with the line of its curve."""
    places = range(len(known))
    width_in = axes.get_position().width * WIDTH_IN
    shares = 100.0 * stroke.posterior(temperature)
    axes.barh(places, shares, color=[strategy.colour for strategy in known], height=0.62)
    for place, (share, strategy) in enumerate(zip(shares, known, strict=True)):
        inside = share > 70.0
        axes.text(
            share + (-2.0 if inside else 2.0),
            place,
            f"{share:.0f} %",
            va="center",
            ha="right" if inside else "left",
            color="white" if inside else INK,
        )
        axes.plot(
            [place_in / width_in for place_in in _SAMPLE_IN],
            (place, place),
            SIDE_LINES[strategy.side],
            color=strategy.colour,
            linewidth=2.0,
            transform=axes.get_yaxis_transform(),
            clip_on=False,
        )
    axes.set_yticks(places, [str(strategy.label) for strategy in known])
    axes.tick_params(axis="y", length=0, pad=_SAMPLE_PAD)
    for name, tick in zip(stroke.labels, axes.get_yticklabels(), strict=True):
        tick.set_fontweight("bold" if name == stroke.episode.label else "normal")
    axes.invert_yaxis()
    calibrated = "not calibrated" if temperature == UNCALIBRATED else "calibrated"
    axes.set(xlim=(0, 100), xlabel=f"share, % ({calibrated})")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title("whose stroke is it?", fontsize=9, loc="left")
