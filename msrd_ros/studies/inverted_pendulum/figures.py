"""The figures that only the pendulum has: rewards over the pole's angle, and what is learned on them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.evaluation import TestSet
from msrd_ros.studies.shared.figures import DARK, LIGHT, new_figure

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


def settled_places(homes: list[float], marks: dict[str, dict[str, Any]]) -> Figure:
    """Where fresh policies settle over where the demonstrators did, a panel for each reward by its name.

    Parameters
    ----------
    homes
        The demonstrators' settled cart positions, in metres.
    marks
        Marks of `transfer.run_transfer` on one body.
    """
    figure, axes = new_figure(len(marks), 3.3, 3.2)
    home = np.array(homes)
    for axis, (name, found) in zip(axes, marks.items(), strict=True):
        place, stands = np.array(found["cart_position"]), np.array(found["fallen"]) == 0.0
        axis.plot([-1.0, 1.0], [-1.0, 1.0], color=LIGHT, lw=0.8, zorder=0)
        axis.scatter(home[stands], place[stands], s=22, marker="o", color=DARK, label="stands")
        axis.scatter(home[~stands], place[~stands], s=22, marker="x", color="#b3202a", label="falls")
        title = f"{name}\n{int(stands.sum())} of {len(home)} stand"
        axis.set(xlabel="demonstrator's cart (m)", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal")
        axis.set_title(title, fontsize=10)
    axes[0].set_ylabel("fresh policy's cart (m)")
    axes[0].legend(frameon=False, fontsize=9, loc="upper left")
    return figure
