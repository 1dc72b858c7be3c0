"""The recorded strokes of a folder, as a page lists, edits and looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.table import StrokeTable
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.requests import Request

LONGEST_S = 1000.0


class Library:
    """Reads and edits a folder of bags; what has not changed is read once.

    Parameters
    ----------
    folder
        Of bags; made if it is not there.
    robot
        The arm that was led.
    """

    def __init__(self, folder: Path, robot: Robot) -> None:
        self.folder = folder
        self._robot = robot
        self._table: StrokeTable | None = None

    def strokes(self, discarded: bool) -> dict[str, Any]:
        """All strokes as rows, and what was mended on the way.

        Raises
        ------
        UserError
            If the folder cannot be made.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(
                f"folder {self.folder}: cannot be made ({error.strerror}); say another: bags:="
            ) from None
        self._table = self._table or StrokeTable(self.folder, self._robot)
        rows = self._table.rows(discarded)
        return {"rows": [asdict(row) for row in rows], "notes": self._table.notes}

    def edit(self, request: Request) -> str:
        """Carry out one of the verbs of `python -m msrd_ros.bags`; what was done.

        Raises
        ------
        UserError
            If the bag or what is asked for is unfit.
        """
        curation = Curation(self.folder, self._robot)
        bag = self.place(request.text("bag"), request.verb == "restore")
        if request.verb == "relabel":
            done = curation.relabel(bag, request.text("label"))
        elif request.verb == "trim":
            begin_s, end_s = (request.within(name, 0.0, LONGEST_S, "s") for name in ("begin", "end"))
            done = curation.trim(bag, begin_s, end_s)
        elif request.verb == "flag":
            done = curation.flag(bag, request.text("text"))
        elif request.verb == "unflag":
            done = curation.unflag(bag)
        elif request.verb == "discard":
            done = curation.discard(bag)
        else:
            done = curation.restore(bag)
        return str(done)

    def discard(self, name: str) -> str:
        """Move a bag aside; what was done.

        Raises
        ------
        UserError
            If there is no such bag.
        """
        return str(Curation(self.folder, self._robot).discard(self.place(name, discarded=False)))

    def relabel(self, name: str, label: str) -> str:
        """Give a bag another label; its new name.

        Raises
        ------
        UserError
            If there is no such bag, or the label is none.
        """
        return Curation(self.folder, self._robot).relabel(self.place(name, discarded=False), label).to

    def episode(self, name: str) -> Episode:
        """The first stroke of a bag.

        Raises
        ------
        UserError
            If there is no such bag in the folder, or it cannot be read.
        """
        return read_episodes(Bag(self.place(name, discarded=True)), self._robot)[0]

    def episodes(self, names: Sequence[str]) -> list[Episode]:
        """The same of several bags."""
        return [self.episode(name) for name in names]

    def place(self, name: str, discarded: bool = False) -> Path:
        """Where a bag of the folder lies or, where `discarded` is meant, has lain.

        Raises
        ------
        UserError
            If there is no such bag in the folder.
        """
        path = self.folder / name
        inside = name and path.resolve().is_relative_to(self.folder.resolve())
        if not inside or not (discarded or path.exists()):
            raise UserError(f"no bag {name!r} in {self.folder.absolute()}; look again")
        return path


VERBS = ("relabel", "trim", "flag", "unflag", "discard", "restore")
"""What `Library.edit` knows."""
