"""The figure that only the pendulum has: rewards over the pole's angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from msrd_ros.experiments.virtual_studies.estimates import Estimate
from msrd_ros.experiments.virtual_studies.evaluation import TestSet
from msrd_ros.experiments.virtual_studies.figures import DARK, LIGHT, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reward_curves(estimate: Estimate, test: TestSet) -> Figure:
    """Rewards over the pole's angle with the rest at zero, and the behaviours (paper, Figure 4)."""
    figure, axes = new_figure(3)
    angle = np.linspace(-0.4, 0.4, 161)
    states = torch.zeros(161, 4)
    states[:, 1] = torch.as_tensor(angle, dtype=torch.float32)
    assert estimate.task is not None
    assert estimate.strategies is not None
    task = estimate.task(states).numpy()
    own = estimate.strategies(states).numpy()
    peaks = angle[own.argmax(axis=1)]
    slopes = own[:, -1] - own[:, 0]
    left, right = int(slopes.argmin()), int(slopes.argmax())
    axes[0].plot(
        angle, task - task.max(), color=DARK, lw=2, label=f"task, peak at {angle[task.argmax()]:+.3f}"
    )
    for strategy, style in ((left, "--"), (right, ":")):
        label = f"strategy {strategy + 1}, peak at {peaks[strategy]:+.2f}"
        axes[0].plot(angle, own[strategy] - own[strategy].max(), style, color=DARK, lw=1.6, label=label)
    axes[0].set(xlabel="pole angle (rad)", ylabel="reward below its peak")
    axes[0].legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    time = np.arange(test.clean.shape[2]) * 0.04
    for axis, column, name in ((axes[1], 0, "cart position (m)"), (axes[2], 1, "pole angle (rad)")):
        for strategy in range(test.clean.shape[0]):
            axis.plot(time, test.clean[strategy, 0, :, column], color=LIGHT, lw=0.5)
        for strategy, style in ((left, "--"), (right, ":")):
            axis.plot(time, test.clean[strategy, 0, :, column], style, color=DARK, lw=1.6)
        axis.set(xlabel="time (s)", ylabel=name)
        if column == 1:
            axis.set_xlim(0.0, 6.0)
    return figure
