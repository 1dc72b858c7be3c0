"""What the rewards of a training run say of strokes, as a picture and in words."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.explain.explanation import Explanation, explain, load_rewards
from msrd_ros.explain.figure import MOST_STROKES, write_figure
from msrd_ros.learning.harness import CHECKPOINT_FILE
from msrd_ros.learning.learned import Learned
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strategies.table import Strategies


class Understanding:
    """Asks the rewards of a run, read again when training has written new ones.

    Parameters
    ----------
    run
        The folder of a training run.
    robot, strategies
        Whose strokes, and the colours of what they are told from.
    """

    def __init__(self, run: Path, robot: Robot, strategies: Strategies) -> None:
        self._run, self._robot, self._strategies = run, robot, strategies
        self._read_ns = 0
        self._learned: Learned | None = None

    def tell(self, episodes: Sequence[Episode]) -> dict[str, Any]:
        """One stroke, or two beside each other.

        Returns
        -------
        ``svg``, the picture; ``strokes``, for each its labels, S_i and R0 by time, and whose it is.

        Raises
        ------
        UserError
            If there are too many strokes, or no rewards to ask.
        """
        if not 1 <= len(episodes) <= MOST_STROKES:
            raise UserError(
                f"{len(episodes)} strokes are chosen; choose one, or two to lay beside each other"
            )
        learned = self._rewards()
        told = [explain(learned, episode) for episode in episodes]
        with tempfile.TemporaryDirectory() as folder:
            picture = Path(folder) / "strokes.svg"
            write_figure(picture, told, [one.title for one in told], self._strategies)
            svg = picture.read_text(encoding="utf-8")
        return {"svg": svg, "strokes": [_as_plain(one) for one in told]}

    def task_rewards(self, episode: Episode) -> Explanation:
        """R0 along one stroke; raises as `tell` does."""
        return explain(self._rewards(), episode)

    def _rewards(self) -> Learned:
        file = self._run / CHECKPOINT_FILE
        if not file.is_file():
            raise UserError(
                f"no rewards to ask: {file} is not there; train first, or name another run: run:=FOLDER"
            )
        changed_ns = file.stat().st_mtime_ns
        if self._learned is None or changed_ns != self._read_ns:
            # Threads that share out networks this small wait for each other.
            torch.set_num_threads(1)
            self._learned, self._read_ns = load_rewards(file, self._robot), changed_ns
        return self._learned


def _as_plain(told: Explanation) -> dict[str, Any]:
    return {
        "title": told.title,
        "labels": list(told.labels),
        "time_s": told.time_s.round(3).tolist(),
        "task": told.task.round(4).tolist(),
        "strategy": told.strategy.T.round(4).tolist(),
        "shares": told.posterior().round(4).tolist(),
        "hit_s": round(told.hit_s, 3),
    }
