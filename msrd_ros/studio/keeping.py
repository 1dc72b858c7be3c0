"""The strokes that were taught on a page: kept or why not, and what a person does with them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.led_stroke import Led
from msrd_ros.studio.library import Library
from msrd_ros.studio.task import Task

MOST_TOLD = 30


@dataclass
class Taught:
    """One stroke that was led, and its bag relative to the folder; empty if it was not kept."""

    number: int
    label: str
    note: str
    outcome: str
    landing_m: tuple[float, float] | None
    why_not: str
    bag: str
    discarded: bool = False

    def told(self) -> dict[str, Any]:
        """As JSON has it."""
        return {**vars(self)}


class Keeping:
    """What was taught since the studio was started, and the verbs for the last of it.

    Parameters
    ----------
    library
        Where the bags are, and what edits them.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._strokes: list[Taught] = []

    @property
    def base(self) -> str:
        """Name of the newest bag that is kept of a stroke a person taught; empty if there is none."""
        own = [one for one in self._strokes if one.bag and not one.discarded and "variation" not in one.note]
        return own[-1].bag if own else ""

    def add(self, task: Task, led: Led) -> None:
        """Enter a stroke."""
        recorded, outcome = led.recorded, led.outcome
        landing = (outcome.landing_x_m, outcome.landing_y_m)
        if recorded is None:
            why_not, bag = "the recorder says nothing about it; see Nodes", ""
        elif recorded.kept:
            why_not, bag = "", self._name(recorded.path)
        else:
            why_not, bag = recorded.detail or recorded.reason, ""
        self._strokes.append(
            Taught(
                len(self._strokes) + 1,
                str(task.label),
                task.note,
                outcome.message,
                (round(landing[0], 3), round(landing[1], 3)) if np.isfinite(landing).all() else None,
                why_not,
                bag,
            )
        )

    def keep(self) -> str:
        """Leave the last stroke as it is."""
        return f"kept: {self._last().bag}"

    def discard(self) -> str:
        """Move the last stroke aside; the journal has it back.

        Raises
        ------
        UserError
            If it was not kept in the first place.
        """
        last = self._last()
        done = self._library.discard(last.bag)
        last.discarded = True
        return done

    def label(self, label: str) -> str:
        """Give the last stroke another label.

        Raises
        ------
        UserError
            If it was not kept, or the label is none.
        """
        last = self._last()
        last.bag = self._library.relabel(last.bag, label)
        last.label = label
        return f"the last stroke is {last.bag} now"

    def told(self) -> list[dict[str, Any]]:
        """The newest strokes, the last first, as JSON has it."""
        return [one.told() for one in reversed(self._strokes[-MOST_TOLD:])]

    def _last(self) -> Taught:
        if not self._strokes or not self._strokes[-1].bag or self._strokes[-1].discarded:
            raise UserError("the last stroke is not kept; teach one first")
        return self._strokes[-1]

    def _name(self, path: str) -> str:
        folder = self._library.folder.resolve()
        bag = Path(path).resolve()
        return bag.relative_to(folder).as_posix() if bag.is_relative_to(folder) else str(bag)
