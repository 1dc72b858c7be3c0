"""Training runs in a folder: what each learned from, how far it came, and what it reached."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from msrd_ros.bags.info import BagInfo
from msrd_ros.contract.labels import WITHOUT_LABEL
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report
from msrd_ros.learning.harness import CHECKPOINT_FILE, RESULT_FILE
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.table_tennis.strokes.run import BOARD_FOLDER
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE

BAGS_FOLDER = "bags"
"""Links to the bags that a run learns from, so that it can go on with the same."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


class Runs:
    """The runs in a folder.

    Parameters
    ----------
    folder
        Each run is a folder in it; made with the first one.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def place(self, name: str) -> Path:
        """Where the run of a name is, or would be.

        Raises
        ------
        UserError
            If it is no name.
        """
        if not _NAME.fullmatch(name):
            raise UserError(f"{name!r} is no name of a run; use 1 to 64 letters, digits, - and _")
        return self.folder / name

    def find(self, name: str) -> Path:
        """Where a run is that exists.

        Raises
        ------
        UserError
            If there is none of that name.
        """
        place = self.place(name)
        if not _is_run(place):
            raise UserError(f"there is no run {name!r} in {self.folder.absolute()}; look again")
        return place

    def free_name(self) -> str:
        """A name that no run has."""
        number = 1
        while (self.folder / f"run-{number}").exists():
            number += 1
        return f"run-{number}"

    def all(self, running: str = "") -> list[dict[str, Any]]:
        """All runs as a page lists them, the newest first.

        Parameters
        ----------
        running
            The name of the one that is under way.
        """
        places = [place for place in self.folder.glob("*") if _is_run(place)]
        places.sort(key=_changed_s, reverse=True)
        return [self.about(place.name, place.name == running) for place in places]

    def about(self, name: str, runs: bool = False) -> dict[str, Any]:
        """One run.

        Returns
        -------
        ``name``, ``state`` (``running``, ``done``, ``stopped`` or ``broken``), ``changed_s``, ``iterations``
        of ``planned``, ``seed``, ``seconds``; ``labels`` with their ``demonstrations`` and the shares
        ``struck`` and ``returned`` of the last evaluation, lists; ``matrix``, the strategy matrix between
        ``groups``; whether it ``goes_on`` from its checkpoint and can be played (``plays``); ``trouble``,
        what is wrong with it.
        """
        place = self.find(name)
        trouble, report = "", {}
        if (place / RESULT_FILE).is_file():
            try:
                report = read_report(place / RESULT_FILE)
            except UserError as error:
                trouble = str(error)
        elif not runs:
            trouble = "it ended before anything was learned"
        config, curve = report.get("config", {}), report.get("curve", [])
        taught = report.get("demonstrations") or _linked(place)
        last = curve[-1] if curve else {}
        done, planned = report.get("iterations", 0), config.get("iterations", 0)
        state = "running" if runs else "broken" if trouble else "done" if done >= planned else "stopped"
        return {
            "name": name,
            "state": state,
            "changed_s": round(_changed_s(place)),
            "iterations": done,
            "planned": planned,
            "seed": config.get("seed", 0),
            "seconds": round(last.get("seconds", 0.0), 1),
            "labels": report.get("labels", list(taught)),
            "demonstrations": taught,
            "struck": last.get("struck", []),
            "returned": last.get("returned", []),
            "groups": report.get("strategy_rewards", []),
            "matrix": report.get("strategy_matrix", []),
            "goes_on": state == "stopped"
            and (place / CHECKPOINT_FILE).is_file()
            and (place / BAGS_FOLDER).is_dir(),
            "plays": (place / POLICIES_FILE).is_file(),
            "trouble": trouble,
        }


def link_bags(run: Path, bags: Sequence[BagInfo]) -> Path:
    """Lay links to bags into a run's folder; the folder of the links.

    Raises
    ------
    UserError
        If one says that it has no label, and then nothing is written; if they cannot be written.
    """
    for bag in bags:
        if bag.unlabelled:
            raise UserError(f"{bag.subject} {bag.path.name}: {WITHOUT_LABEL}")
    folder = run / BAGS_FOLDER
    try:
        for number, bag in enumerate(bags, start=1):
            link = folder / f"{number:04d}" / bag.path.name  # a bag's own name may say its label
            link.parent.mkdir(parents=True)
            link.symlink_to(bag.path.absolute())
    except OSError as error:
        raise UserError(
            f"run {run}: cannot be written ({error.strerror}); say another folder: runs:="
        ) from None
    return folder


def _linked(run: Path) -> dict[str, int]:
    """Demonstrations by label of a run that has not written anything yet."""
    try:
        bags = BagLibrary.scan(run / BAGS_FOLDER).bags
    except UserError:
        return {}
    return count_labels(bags)


def count_labels(bags: Iterable[BagInfo]) -> dict[str, int]:
    """How many bags each label has, by name."""
    return dict(sorted(Counter(str(bag.label) for bag in bags).items()))


def _is_run(place: Path) -> bool:
    return any((place / name).exists() for name in (RESULT_FILE, BAGS_FOLDER, BOARD_FOLDER))


def _changed_s(place: Path) -> float:
    """When it last got on, s since the epoch."""
    return max((place / name).stat().st_mtime for name in (RESULT_FILE, ".") if (place / name).exists())
