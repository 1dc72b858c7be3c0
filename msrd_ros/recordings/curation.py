"""Editing a folder of bags: relabel, trim, flag, discard, and take any of it back."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from msrd_ros.bags.info import read_info
from msrd_ros.bags.metadata import split_name
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.rewriting import Change, require_rewritable, rewrite_bag
from msrd_ros.bags.writer import next_number
from msrd_ros.contract.labels import read_label, say_label
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.changes import relabelling, require_stroke, trimming
from msrd_ros.recordings.history import History, find_library
from msrd_ros.recordings.journal import (
    ASIDE,
    DISCARD,
    FLAG,
    RELABEL,
    RESTORE,
    TRIM,
    UNFLAG,
    Edit,
    Move,
    is_edit_id,
)
from msrd_ros.robots.robot import Robot


class Curation(History):
    """Edits the bags of one folder; all that it replaces can be had back.

    Parameters
    ----------
    folder
        Of bags.
    robot
        The arm that was led; the default one if None.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.

    Raises
    ------
    UserError
        If there is no such folder.
    """

    def __init__(
        self, folder: Path | str, robot: Robot | None = None, names: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(folder)
        self._robot, self._names = robot, names

    @classmethod
    def of(
        cls, bag: Path | str, robot: Robot | None = None, names: Mapping[str, str] | None = None
    ) -> Curation:
        """That of the folder which a bag belongs to.

        The nearest one above it that has been edited before; else, where its folder has its subject's name,
        as the recorder makes it, the one above; else the one that it lies in.
        """
        real = Path(bag).resolve()
        folder = find_library(real.parent)
        if folder is None:
            try:
                subject = read_info(real).subject
            except UserError:
                subject = ""
            folder = real.parent.parent if subject == real.parent.name else real.parent
        return cls(folder, robot, names)

    # -- edits -----------------------------------------------------------------------------------------------

    def relabel(self, bag: Path | str, label: str) -> Edit:
        """Give a bag another label: in its metadata and name, and in all headers where the old one stands.

        A bag called ``<label>_<nnn>`` gets the new label's next number; any other keeps its name. No text, or
        ``unlabelled``, takes the label away; a bag that has none gets its new one where headers are empty.

        Raises
        ------
        UserError
            If `label` is no well-formed name, or the bag's own already; if the bag cannot be read or written
            anew, or shows several strategies.
        """
        new = read_label(label, "label")
        with self._editing(bag) as name:
            original = Bag(self.folder / name, self._names)
            require_rewritable(original.info)
            labels = original.labels(original.raw())
            if len(labels) > 1:
                told = ", ".join(sorted(labels))
                raise UserError(f"bag {bag}: shows several strategies ({told}); record one bag a stroke")
            old = next(iter(labels), None)
            if new == old:
                raise UserError(f"bag {bag}: is {say_label(old)} already; give another label")
            target = Path(name)
            if split_name(target.name) is not None:
                number = next_number((self.folder / name).parent, new)
                target = target.with_name(f"{say_label(new)}_{number:03d}")
            custom = {**original.info.custom_data, "label": str(new or "")}
            edit = Edit(self.journal.next_id(), RELABEL, name, target.as_posix())
            edit = replace(edit, before={"label": say_label(old)}, after={"label": say_label(new)})
            return self._replace(edit, original, relabelling(original, old or "", new or ""), custom)

    def trim(self, bag: Path | str, begin_s: float, end_s: float) -> Edit:
        """Keep what was recorded between two times, in s from the bag's start.

        What was said before and still counts (robot, strategy, feed) is told at the new beginning.

        Raises
        ------
        UserError
            If the bag cannot be read or written anew, the times are not within it, or what is left would be
            no stroke: says what the inspection finds.
        """
        with self._editing(bag) as name:
            original = Bag(self.folder / name, self._names)
            require_rewritable(original.info)
            length_s = original.info.duration_ns / 1e9
            if not (math.isfinite(begin_s) and math.isfinite(end_s) and 0.0 <= begin_s < end_s):
                raise UserError(f"trim: {begin_s} to {end_s} s is no stretch; give begin < end, 0 or more")
            if begin_s >= length_s or (begin_s == 0.0 and end_s >= length_s):
                raise UserError(f"bag {bag}: is {length_s:.3f} s long; give times that leave out some of it")
            start_ns = original.raw()[0].log_time_ns
            begin_ns, end_ns = start_ns + round(begin_s * 1e9), start_ns + round(end_s * 1e9)
            before = {"begin_s": 0.0, "end_s": length_s}
            after = {"begin_s": begin_s, "end_s": min(end_s, length_s)}
            edit = Edit(self.journal.next_id(), TRIM, name, name, before=before, after=after)
            change = trimming(original, begin_ns, end_ns)
            return self._replace(edit, original, change, original.info.custom_data, check=True)

    def flag(self, bag: Path | str, text: str) -> Edit:
        """Note something about a bag, in the journal; the bag itself stays as it is.

        Raises
        ------
        UserError
            If there is no such bag, the text is empty or not one line, or the bag has this flag already.
        """
        if not text.strip() or not text.isprintable():
            raise UserError(f"flag: {text!r} is no note; write one line")
        with self._editing(bag) as name:
            flags = self.flags().get(name, ())
            if text in flags:
                raise UserError(f"bag {bag}: is flagged with {text!r} already")
            return self._note(FLAG, name, flags, (*flags, text))

    def unflag(self, bag: Path | str, text: str | None = None) -> Edit:
        """Take a flag off a bag; all of them where `text` is None.

        Raises
        ------
        UserError
            If the bag has no such flag.
        """
        with self._editing(bag) as name:
            flags = self.flags().get(name, ())
            if not flags or text not in (None, *flags):
                told = ", ".join(map(repr, flags)) or "none"
                raise UserError(f"bag {bag}: has no such flag; it has {told}")
            return self._note(UNFLAG, name, flags, tuple(one for one in flags if text not in (None, one)))

    def discard(self, bag: Path | str) -> Edit:
        """Move a bag aside, whatever its state; `restore` has it back.

        Raises
        ------
        UserError
            If there is no such bag in the folder.
        """
        with self._editing(bag) as name:
            identity = self.journal.next_id()
            aside = f"{ASIDE}/{identity}/{name}"
            moves = (Move.plan(self.folder, name, aside),)
            return self.journal.carry_out(Edit(identity, DISCARD, name, aside, aside=aside, moves=moves))

    def restore(self, bag: Path | str) -> Edit:
        """Take back the last edit of a bag: relabel, trim and discard alike.

        Parameters
        ----------
        bag
            Where the bag is, or was before it was discarded or relabelled; or an edit's id.

        Raises
        ------
        UserError
            If there is nothing to take back, a later edit has to be taken back first, or something else has
            the bag's place by now.
        """
        if not self.journal.aside.is_dir():
            raise UserError(f"bag {bag}: was not edited; there is nothing to take back")
        with self.journal.locked() as self.mended:
            standing = self.standing()
            edit = self._sought(Path(bag), standing)
            if edit is None:
                return self._restore_recorders(Path(bag))
            since = standing[standing.index(edit) + 1 :]
            later = [other for other in since if other.bag == edit.to]
            if later:
                raise UserError(f"{edit.id}: {later[-1].id} came after it; restore that first")
            return self._bring_back(edit.aside, edit.bag, edit)

    # -- how -------------------------------------------------------------------------------------------------

    @contextmanager
    def _editing(self, bag: Path | str) -> Iterator[str]:
        """Hold the journal for an edit of a bag; its path relative to the folder."""
        mended = self.mend()
        self.locate(bag)  # before anything is written into a folder that has no such bag
        with self.journal.locked() as self.mended:
            self.mended = mended + self.mended
            yield self.locate(bag)

    def _replace(
        self,
        edit: Edit,
        original: Bag,
        change: Change,
        custom_data: Mapping[str, str],
        check: bool = False,
    ) -> Edit:
        """Write a bag anew aside, let it be judged, and put it in the place of the old one."""
        staged, aside = f"{ASIDE}/{edit.id}/{edit.to}", f"{ASIDE}/{edit.id}/{edit.bag}"
        try:
            rewrite_bag(original.info, self.folder / staged, change, custom_data)
            if check:
                require_stroke(self.folder / staged, original, self._robot, self._names)
        except BaseException as error:
            # It was written by this very call, and nobody wants it.
            shutil.rmtree(self.folder / ASIDE / edit.id, ignore_errors=True)
            if isinstance(error, OSError):
                raise UserError(
                    f"bag {self.folder / edit.bag}: cannot be written anew ({error.strerror}); it is as "
                    f"it was, so mend that and repeat"
                ) from None
            raise
        # The new one first: at no moment is there none of the two. Of one name, they change places at once.
        moves = [Move.plan(self.folder, staged, edit.to, swap=edit.to == edit.bag)]
        if edit.to != edit.bag:
            moves.append(Move.plan(self.folder, edit.bag, aside))
        return self.journal.carry_out(replace(edit, aside=aside, moves=tuple(moves)))

    def _note(self, verb: str, name: str, before: tuple[str, ...], after: tuple[str, ...]) -> Edit:
        edit = Edit(
            self.journal.next_id(), verb, name, name, before={"flags": before}, after={"flags": after}
        )
        return self.journal.carry_out(edit)

    def _sought(self, bag: Path, standing: list[Edit]) -> Edit | None:
        if is_edit_id(bag.name):
            found = [edit for edit in standing if edit.id == bag.name]
            if not found:
                known = ", ".join(edit.id for edit in standing) or "none"
                raise UserError(f"{bag.name}: is no edit that can be taken back; there are {known}")
            return found[0]
        name = self.relative(bag.parent.resolve() / bag.name)
        return next((edit for edit in reversed(standing) if name in (edit.to, edit.bag)), None)

    def _restore_recorders(self, bag: Path) -> Edit:
        """Have back what the recorder has discarded, which writes no journal."""
        name = self.relative(bag.parent.resolve() / bag.name)
        homes = self.discarded()
        wanted = name if name in homes else next((one for one, home in homes.items() if home == name), None)
        if wanted is None:
            raise UserError(f"bag {bag}: was not edited; there is nothing to take back")
        return self._bring_back(wanted, homes[wanted], None)

    def _bring_back(self, aside: str, home: str, edit: Edit | None) -> Edit:
        identity = self.journal.next_id()
        present = edit.to if edit is not None and edit.verb != DISCARD else ""
        if not (self.folder / aside).exists():
            raise UserError(f"{self.folder / aside}: is gone; somebody has moved it, so put it back first")
        if present != home and os.path.lexists(self.folder / home):
            raise UserError(
                f"bag {self.folder / home}: something else has this name by now; relabel, rename or discard "
                f"it, and repeat"
            )
        moves = [Move.plan(self.folder, aside, home, swap=os.path.lexists(self.folder / home))]
        replaced = aside if moves[0].swap else ""
        if present != home and present and os.path.lexists(self.folder / present):
            replaced = f"{ASIDE}/{identity}/{present}"
            moves.append(Move.plan(self.folder, present, replaced))
        back = Edit(identity, RESTORE, aside, home, aside=replaced, moves=tuple(moves))
        if edit is not None:
            back = replace(back, bag=edit.to, takes_back=edit.id, before=edit.after, after=edit.before)
        return self.journal.carry_out(back)
