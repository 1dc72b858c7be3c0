"""Curves of a training run, read while they are written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tensorboard.backend.event_processing.event_file_loader import EventFileLoader

from msrd_ros.table_tennis.strokes.run import BOARD_FOLDER

MOST_POINTS = 300
"""Of a curve as a page draws it."""

Points = list[tuple[int, float]]
"""Iteration and value, in the order of iterations."""


class Curves:
    """The figures that a trainer writes for TensorBoard, each file read on where it ended the last time.

    Parameters
    ----------
    run
        The folder of the run.
    """

    def __init__(self, run: Path) -> None:
        self._board = run / BOARD_FOLDER
        self._files: dict[Path, EventFileLoader] = {}
        self._values: dict[str, dict[int, float]] = {}

    def read(self) -> dict[str, Points]:
        """Curves by name, such as ``returned/my-smash``, thinned to what a page can show.

        Of an iteration that was done twice, before and after a run was resumed, the later value counts.
        """
        for path in sorted(self._board.glob("events.*")):
            file = self._files.setdefault(path, EventFileLoader(str(path)))
            for event in file.Load():
                for value in event.summary.value:
                    self._values.setdefault(value.tag, {})[event.step] = float(value.tensor.float_val[0])
        return {name: thinned(sorted(values.items())) for name, values in sorted(self._values.items())}


def thinned(points: Sequence[tuple[int, float]], most: int = MOST_POINTS) -> Points:
    """At most so many points, evenly chosen, the first and the last among them."""
    if len(points) <= most:
        return list(points)
    return [points[round(number * (len(points) - 1) / (most - 1))] for number in range(most)]
