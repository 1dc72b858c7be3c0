"""What was done to the bags of a folder, and how an edit that was cut off is brought to its end.

Nothing is ever deleted: what an edit replaces moves to ``.discarded/<edit>/`` of the folder, where no library
looks. ``.discarded/journal.jsonl`` gets a line before an edit moves anything and one when all has been moved,
each on the disk before the next step; so whoever comes after a crash knows what was under way.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import exchange, make_folder, sync_folder

ASIDE = ".discarded"
"""The folder, beside the bags, of all that was moved aside."""
JOURNAL_FILE = "journal.jsonl"

BEGUN, DONE, UNDONE = "begun", "done", "undone"

RELABEL, TRIM, DISCARD, RESTORE, FLAG, UNFLAG = "relabel", "trim", "discard", "restore", "flag", "unflag"

_ID = re.compile(r"edit-(\d+)")
"""A hyphen is in no subject's name, so no subject's folder is called so."""


class Move(NamedTuple):
    """One rename, below the folder.

    Attributes
    ----------
    source, target
        Paths relative to the folder.
    inode
        Of what is moved: tells a swap that is done from one that is not.
    swap
        Whether the two change places, in one step; else there is nothing at the target before.
    """

    source: str
    target: str
    inode: int
    swap: bool

    @classmethod
    def plan(cls, folder: Path, source: str, target: str, swap: bool = False) -> Move:
        """A move of what lies at the source now."""
        return cls(source, target, _inode(folder / source), swap)

    def is_done(self, folder: Path) -> bool:
        """Whether it has happened."""
        if self.swap:
            return _inode(folder / self.target) == self.inode
        return not os.path.lexists(folder / self.source)

    def perform(self, folder: Path) -> None:
        """Do it, on the disk when this returns."""
        source, target = folder / self.source, folder / self.target
        make_folder(target.parent)
        if self.swap:
            exchange(source, target)
        else:
            source.rename(target)
        sync_folder(target.parent)
        sync_folder(source.parent)


@dataclass(frozen=True)
class Edit:
    """A line of the journal.

    Attributes
    ----------
    id
        ``edit-<number>``.
    verb
        What was done.
    bag, to
        Where the bag was and where it is since, relative to the folder.
    time
        When it was begun, UTC; the journal fills it in.
    aside
        Where what it replaced lies; empty where nothing was replaced.
    before, after
        What was changed.
    moves
        What it takes to do it, in this order.
    takes_back
        Id of the edit that a `restore` takes back.
    state
        ``begun``, ``done`` or ``undone``: cut off before it had moved anything.
    """

    id: str
    verb: str
    bag: str
    to: str
    time: str = ""
    aside: str = ""
    before: Mapping[str, Any] = field(default_factory=dict)
    after: Mapping[str, Any] = field(default_factory=dict)
    moves: tuple[Move, ...] = ()
    takes_back: str = ""
    state: str = BEGUN

    def __str__(self) -> str:
        if self.verb == RESTORE:
            return f"{self.id}: {self.to} is back as it was before {self.takes_back or 'it was discarded'}"
        where = f"{self.bag}, now {self.to}" if self.to not in (self.bag, self.aside) else self.bag
        changes = ", ".join(
            f"{key} {_say(self.before.get(key))} -> {_say(self.after[key])}" for key in self.after
        )
        return f"{self.id}: {self.verb} {where}{f': {changes}' if changes else ''}"


def is_edit_id(text: str) -> bool:
    """Whether a name is an edit's id."""
    return _ID.fullmatch(text) is not None


class Journal:
    """The edits of a folder, for one process at a time.

    Parameters
    ----------
    folder
        Of bags.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.aside = folder / ASIDE
        self._file = self.aside / JOURNAL_FILE

    @contextmanager
    def locked(self) -> Iterator[list[str]]:
        """Hold the journal, so that nobody else edits; what was cut off before is brought to its end first.

        Yields
        ------
        What was mended, for a person.

        Raises
        ------
        UserError
            If the folder cannot be written.
        """
        try:
            make_folder(self.aside)
            stream = self._file.open("ab")
        except OSError as error:
            raise UserError(
                f"folder {self.folder}: cannot be written ({error.strerror}); make it writable to edit it"
            ) from None
        with stream:
            fcntl.flock(stream, fcntl.LOCK_EX)  # the system lets go of it however the process ends
            try:
                mended = self._mend()
            except OSError as error:
                raise UserError(
                    f"folder {self.folder}: an edit that was cut off cannot be finished ({error.strerror}); "
                    f"make the folder writable, and repeat"
                ) from None
            yield mended

    def edits(self) -> list[Edit]:
        """All edits, each with its last state; lines that were cut off in writing are passed over."""
        found: dict[str, Edit] = {}
        for line in self._lines():
            try:
                entry = json.loads(line)
                if "verb" in entry:
                    moves = tuple(Move(*move) for move in entry.pop("moves"))
                    found[entry["id"]] = Edit(**entry, moves=moves)
                else:
                    found[entry["id"]] = replace(found[entry["id"]], state=entry["state"])
            except (ValueError, TypeError, KeyError):
                continue
        return list(found.values())

    def next_id(self) -> str:
        """An id that no edit has had."""
        names = [edit.id for edit in self.edits()]
        names += [entry.name for entry in self.aside.glob("edit-*")]
        numbers = [int(match[1]) for match in map(_ID.fullmatch, names) if match]
        return f"edit-{1 + max(numbers, default=0)}"

    def carry_out(self, edit: Edit) -> Edit:
        """Write an edit down, move what it moves, and write that down; the journal has to be locked.

        Raises
        ------
        UserError
            If that fails; what has been begun is brought to its end, or is told of, by the next call.
        """
        edit = replace(edit, time=_now())
        try:
            self._append(asdict(edit))
            for move in edit.moves:
                move.perform(self.folder)
            self._append({"id": edit.id, "time": _now(), "state": DONE})
        except OSError as error:
            raise UserError(
                f"bag {self.folder / edit.bag}: cannot {edit.verb} it ({error.strerror}); nothing is "
                f"lost: make the folder writable, on a file system that can exchange two names, and repeat"
            ) from None
        return replace(edit, state=DONE)

    def _mend(self) -> list[str]:
        said = []
        for edit in self.edits():
            if edit.state != BEGUN:
                continue
            left = [move for move in edit.moves if not move.is_done(self.folder)]
            state = UNDONE if edit.moves and len(left) == len(edit.moves) else DONE
            if state == DONE:
                for move in left:
                    move.perform(self.folder)
            self._append({"id": edit.id, "time": _now(), "state": state})
            how = "had moved nothing; repeat it if it is still wanted" if state == UNDONE else "is done now"
            said.append(f"{edit.id} ({edit.verb} {edit.bag}) was cut off and {how}")
        return said

    def _lines(self) -> list[bytes]:
        try:
            return self._file.read_bytes().split(b"\n")
        except FileNotFoundError:
            return []
        except OSError as error:
            raise UserError(f"{self._file}: cannot be read ({error.strerror}); make it readable") from None

    def _append(self, entry: Mapping[str, Any]) -> None:
        new = not self._file.exists() or not self._file.stat().st_size
        torn = not new and not self._file.read_bytes().endswith(b"\n")
        with self._file.open("ab") as stream:
            # What was cut off in writing stays, on a line of its own.
            stream.write(b"\n" * torn + json.dumps(entry).encode() + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        if new:
            sync_folder(self.aside)


def _say(value: object) -> str:
    if isinstance(value, list | tuple):
        return " and ".join(map(repr, value)) or "none"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _inode(path: Path) -> int:
    try:
        return os.lstat(path).st_ino
    except FileNotFoundError:
        return -1
