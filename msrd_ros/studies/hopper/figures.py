"""The figure that only the Hopper has: strategy rewards along a hop and a crawl, under film strips."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.studies.hopper.demonstrators import LABELS
from msrd_ros.studies.hopper.environment import CONTROL_PERIOD_S, HopperBody
from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.figures import DARK, LIGHT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FRAMES, _FRAME_STEPS, _FIRST_FRAME, _SPACING_M = 9, 12, 500, 1.9
_SMOOTHING_STEPS = 25


def strategy_strips(estimate: Estimate, clean: NDArray[np.floating]) -> Figure:
    """Film strips over rewards (paper, Figure 6): left a hop, right a crawl.

    Parameters
    ----------
    estimate
        Its strategy rewards are drawn, each with its mean over both trajectories taken off, over its spread.
    clean
        ``[2, n, T+1, 12]``; the first trajectory of each strategy is shown.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    assert estimate.strategies is not None
    tracks = clean[:, 0, 1:]
    steps = tracks.shape[1]
    values = estimate.strategies(torch.as_tensor(tracks.reshape(2 * steps, -1), dtype=torch.float32)).numpy()
    values = (values - values.mean(axis=1, keepdims=True)) / (values.std(axis=1, keepdims=True) + 1e-9)
    values = values.reshape(2, 2, steps)
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 5.0), height_ratios=(1.0, 1.3), sharey="row")
    time = np.arange(steps) * CONTROL_PERIOD_S
    for column, label in enumerate(LABELS):
        film_strip(axes[0, column], tracks[column])
        axes[0, column].set_title(f"a {label}, a frame every {_FRAME_STEPS * CONTROL_PERIOD_S:.2f} s")
        curve = axes[1, column]
        curve.spines[["top", "right"]].set_visible(False)
        for strategy, (color, style) in enumerate(((DARK, "-"), (DARK, ":"))):
            curve.plot(time, values[strategy, column], color=LIGHT, lw=0.4)
            smooth = np.convolve(
                values[strategy, column], np.ones(_SMOOTHING_STEPS) / _SMOOTHING_STEPS, "same"
            )
            curve.plot(time, smooth, style, color=color, lw=1.6, label=f"S of {LABELS[strategy]}")
        curve.set(xlabel="time (s)")
    axes[1, 0].set_ylabel("strategy reward (deviations)")
    axes[1, 0].legend(frameon=False, fontsize=9)
    figure.tight_layout()
    return figure


def film_strip(axis: Axes, track: NDArray[np.floating]) -> None:
    """Draw the links at regular steps of ``track [T, 12]``, frames set apart so that they do not overlap."""
    model = HopperBody().model()
    data = mujoco.MjData(model)
    width = model.nq
    last = len(track) - 1
    for frame in range(_FRAMES):
        step = min(_FIRST_FRAME + frame * _FRAME_STEPS, last)
        data.qpos[:] = track[step, :width]
        data.qpos[0] = frame * _SPACING_M
        mujoco.mj_forward(model, data)
        for geom in range(1, model.ngeom):
            along = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            ends = np.stack([data.geom_xpos[geom] - along, data.geom_xpos[geom] + along])
            thickness = 60.0 * float(model.geom_size[geom, 0])
            axis.plot(ends[:, 0], ends[:, 2], color=DARK, lw=thickness, solid_capstyle="round", alpha=0.8)
    axis.axhline(0.0, color=LIGHT, lw=1.0)
    axis.set(xlim=(-1.7, _FRAMES * _SPACING_M), ylim=(-0.1, 2.0), xticks=[], yticks=[], aspect="equal")
    axis.spines[:].set_visible(False)
