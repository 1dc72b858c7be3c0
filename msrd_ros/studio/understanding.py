"""What the rewards of a training run say of strokes, as a picture and in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.explain.explanation import Explanation, explain, load_rewards
from msrd_ros.explain.figure import render
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

    def explain(self, episodes: Sequence[Episode]) -> list[Explanation]:
        """What the rewards say of some strokes.

        Raises
        ------
        UserError
            If there are no rewards to ask.
        """
        learned = self._rewards()
        return [explain(learned, episode) for episode in episodes]

    def picture(self, told: Sequence[Explanation]) -> dict[str, Any]:
        """One stroke, or two beside each other, for a page.

        Returns
        -------
        ``svg``, the picture; ``strokes``, for each its labels, S_i and R0 by time, and whose it is.
        """
        svg = render("svg", told, [one.title for one in told], self._strategies)
        return {"svg": svg.decode(), "strokes": [_as_plain(one) for one in told]}

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
