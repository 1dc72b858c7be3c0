"""A training run of strokes: what its harness evaluates, tells and writes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from torch.utils.tensorboard import SummaryWriter

from msrd_ros.contract.episode import FIRST_ACTING_STEP, Episode
from msrd_ros.core.files import write_atomically
from msrd_ros.learning.harness import Harness, Schedule, Task
from msrd_ros.table_tennis.strokes.frozen import REWARDS_FILE, save_rewards
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE, StrokeTraining

BOARD_FOLDER = "tensorboard"
BOARD_PERIOD_S = 1
"""How long figures wait before they are in the file: who looks on wants to see them."""


class StrokeTask(Task):
    """Evaluates strokes in the batched simulator.

    Parameters
    ----------
    training
        What is trained.
    evaluation_balls
        Balls per strategy in each evaluation.
    """

    def __init__(self, training: StrokeTraining, evaluation_balls: int) -> None:
        self.training = training
        self._balls = evaluation_balls
        self._evaluations = np.random.default_rng((training.config.seed, 1))

    def evaluate(self) -> dict[str, Any]:
        """Shares of struck and of returned balls, lists by strategy."""
        struck, returned = self.training.evaluate(self._balls, self._evaluations)
        return {"struck": struck.tolist(), "returned": returned.tolist()}

    def summary(self, harness: Harness) -> str:
        """Share of balls returned in the latest evaluation."""
        return f"returned {100 * np.mean(harness.curve[-1]['returned']):.0f} %" if harness.curve else ""


class RunTask(StrokeTask):
    """A user's run: also TensorBoard, and policies and results on disk.

    Parameters
    ----------
    training, evaluation_balls
        As of `StrokeTask`.
    episodes
        The demonstrations, for the strategy matrix.
    out
        Folder for TensorBoard.
    on_policies
        Called with the policies after cloning and after every evaluation.
    on_iteration
        Called after every iteration with its figures by name.
    recheck
        Says, of the folder with a checkpoint, whether what was learned agrees with strategies that were
        found; None where none were.
    """

    def __init__(
        self,
        training: StrokeTraining,
        evaluation_balls: int,
        episodes: Sequence[Episode],
        out: Path,
        on_policies: Callable[[StrokePolicies], None],
        on_iteration: Callable[[dict[str, float]], None],
        recheck: Callable[[Path], dict[str, Any]] | None = None,
    ) -> None:
        super().__init__(training, evaluation_balls)
        self._episodes = episodes
        self._on_policies, self._on_iteration, self._recheck = on_policies, on_iteration, recheck
        self._board = SummaryWriter(str(out / BOARD_FOLDER), flush_secs=BOARD_PERIOD_S)

    def close(self) -> None:
        """Let go of TensorBoard's file."""
        self._board.close()

    def at_point(self, harness: Harness) -> None:
        """Hand on the policies."""
        for label, share in self._returned(harness).items():
            self._board.add_scalar(f"returned/{label}", share, harness.iteration)
        self._on_policies(self.training.policies())

    def after_iteration(self, harness: Harness) -> None:
        """Hand on the figures."""
        for name, value in harness.metrics.items():
            self._board.add_scalar(f"training/{name}", value, harness.iteration)
        figures = {
            "iteration": harness.iteration,
            "of": harness.planned,
            "seconds_left": harness.seconds_left,
        }
        returned = {f"returned_{label}": share for label, share in self._returned(harness).items()}
        self._on_iteration({**figures, **returned, **harness.metrics})

    def at_end(self, harness: Harness) -> None:
        """Write rewards that other arms may learn from."""
        assert harness.schedule.out is not None
        save_rewards(self.training, harness.schedule.out / REWARDS_FILE)

    def _returned(self, harness: Harness) -> dict[str, float]:
        """Shares by label in the latest evaluation."""
        labels = map(str, self.training.labels)
        return dict(zip(labels, harness.curve[-1]["returned"], strict=True)) if harness.curve else {}

    def save(self, out: Path) -> dict[str, Any]:
        """Write the policies; gives settings and what the rewards say."""
        training = self.training
        self._board.flush()
        write_atomically(out / POLICIES_FILE, training.policies().to_bytes())
        demonstrations = np.stack([e.observations[FIRST_ACTING_STEP:] for e in self._episodes])
        return {
            "labels": [str(label) for label in training.labels],
            "config": asdict(training.config),
            "demonstrations": Counter(str(episode.strategy) for episode in self._episodes),
            "strategy_rewards": list(training.reward_groups),
            "strategy_matrix": training.strategy_matrix(self._episodes).tolist(),
            "task_reward_of_demonstrations": float(training.rewards_of(demonstrations, 0)[0].mean()),
            **({"recheck": self._recheck(out)} if self._recheck is not None else {}),
        }


def training_run(task: RunTask, schedule: Schedule) -> Harness:
    """The run of a user's training."""
    return Harness(task.training.trainer, task, schedule, task.training.method.title)
