"""What was done to the bags of a folder: their flags, what is discarded, what can be taken back."""

from __future__ import annotations

import re
from pathlib import Path

from msrd_ros.bags.finding import find_bags
from msrd_ros.bags.metadata import METADATA_FILE
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.journal import (
    ASIDE,
    BEGUN,
    DISCARD,
    DONE,
    FLAG,
    RELABEL,
    TRIM,
    UNFLAG,
    Edit,
    Journal,
    is_edit_id,
)

_NUMBERED = re.compile(r"-[0-9a-f]{8}$")
"""What the recorder adds to the name of a second bag of one name that it discards."""


def find_library(path: Path) -> Path | None:
    """The nearest folder, at or above a path, whose bags have been edited; None if there is none."""
    real = path.resolve()
    return next((folder for folder in (real, *real.parents) if (folder / ASIDE).is_dir()), None)


class History:
    """The edits of one folder's bags, as its journal tells them.

    Parameters
    ----------
    folder
        Of bags.

    Attributes
    ----------
    folder
        The same, without links.
    journal
        Where it stands.
    mended
        What the last call found cut off by a crash, and what it made of it.

    Raises
    ------
    UserError
        If there is no such folder.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).resolve()
        if not self.folder.is_dir():
            raise UserError(f"folder {folder}: does not exist; give a folder of bags")
        self.journal = Journal(self.folder)
        self.mended: list[str] = []

    def edits(self) -> list[Edit]:
        """All that was done, in order; nothing is changed, nor waited for."""
        return self.journal.edits()

    def flags(self) -> dict[str, tuple[str, ...]]:
        """What bags are flagged with, by path relative to the folder."""
        found: dict[str, tuple[str, ...]] = {}
        for edit in self.edits():
            if edit.state != DONE:
                continue
            if edit.verb in (FLAG, UNFLAG):
                found[edit.bag] = tuple(edit.after["flags"])
            elif edit.bag in found:
                found[edit.to] = found.pop(edit.bag)
        return {bag: texts for bag, texts in found.items() if texts}

    def discarded(self) -> dict[str, str]:
        """Discarded bags: their path relative to the folder by where they were, the recorder's too."""
        found = {edit.to: edit.bag for edit in self.standing() if edit.verb == DISCARD}
        for entry in sorted(self.journal.aside.glob("*")):
            if entry.is_dir() and not is_edit_id(entry.name):
                for bag in find_bags(entry):
                    home = self.relative(bag).removeprefix(f"{ASIDE}/")
                    found[self.relative(bag)] = _NUMBERED.sub("", home)
        return {bag: home for bag, home in found.items() if (self.folder / bag).exists()}

    def mend(self) -> list[str]:
        """Bring to its end what a crash has cut off; what that was, for a person."""
        if self.journal.aside.is_dir() and any(edit.state == BEGUN for edit in self.edits()):
            with self.journal.locked() as self.mended:
                return self.mended
        return []

    def standing(self) -> list[Edit]:
        """Edits that have moved something and are not taken back."""
        done = [edit for edit in self.edits() if edit.state == DONE]
        taken_back = {edit.takes_back for edit in done}
        return [edit for edit in done if edit.verb in (RELABEL, TRIM, DISCARD) and edit.id not in taken_back]

    def relative(self, path: Path) -> str:
        """A path relative to the folder.

        Raises
        ------
        UserError
            If it is not in the folder.
        """
        try:
            return path.relative_to(self.folder).as_posix()
        except ValueError:
            raise UserError(
                f"bag {path}: is not in {self.folder}; edit it in the folder it lies in"
            ) from None

    def locate(self, bag: Path | str) -> str:
        """A bag's path relative to the folder.

        Raises
        ------
        UserError
            If it is none of the folder's bags, or a link to one.
        """
        path = Path(bag)
        if path.is_symlink():
            raise UserError(f"bag {bag}: is a link to {path.resolve()}; name that")
        name = self.relative(path.resolve())
        if name.split("/")[0] == ASIDE:
            raise UserError(f"bag {bag}: is discarded; restore it first")
        if path.is_file() and self._is_part(path):
            raise UserError(f"bag {bag}: is a file of the bag {path.parent}; name that")
        if name == "." or not path.exists() or find_bags(path) != [path]:
            state = "is no bag" if path.exists() else "does not exist"
            raise UserError(f"bag {bag}: {state}; name a bag's directory or MCAP file in {self.folder}")
        return name

    def _is_part(self, file: Path) -> bool:
        folder = file.resolve().parent
        is_bag = folder != self.folder and find_bags(folder) == [folder]
        return is_bag or (folder / METADATA_FILE).is_file()
