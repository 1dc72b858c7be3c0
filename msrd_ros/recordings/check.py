"""Checking bags: what of a folder may serve as demonstrations, what may not and why."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from msrd_ros.bags.finding import find_bags, require_bags_at
from msrd_ros.bags.info import read_info
from msrd_ros.contract.labels import UNLABELLED, WITHOUT_LABEL
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import BagReading, read_bags
from msrd_ros.robots.robot import Robot


@dataclass(frozen=True)
class CheckedBag:
    """What was found of a bag.

    Attributes
    ----------
    bag
        Its path below the folder; ``.`` for the folder itself.
    strokes
        How many are accepted.
    refused
        Every reason why the bag or one of its strokes is not, with places in s from the bag's start; None if
        all are accepted.
    notes
        What is no fault, but should be known.
    """

    bag: str
    strokes: int
    refused: str | None
    notes: list[str]

    def __str__(self) -> str:
        count = f"{self.strokes} stroke{'s' * (self.strokes != 1)}"
        refused = f", refused: {self.refused}" if self.refused is not None else ""
        return "\n".join([f"{self.bag}: {count}{refused}", *(f"  note: {note}" for note in self.notes)])


def check(path: Path, robot: Robot, names: Mapping[str, str] | None = None) -> list[CheckedBag]:
    """Inspect all bags at or below a folder, sorted by path.

    Parameters
    ----------
    path
        A folder, a bag or an MCAP file.
    robot
        The arm that was led.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.

    Raises
    ------
    UserError
        If there is no such folder, or it is another file.
    """
    require_bags_at(path, str(path))
    checked = [_check_one(found, path, robot, names) for found in find_bags(path)]
    return sorted(checked, key=lambda one: one.bag)


def write_json(checked: list[CheckedBag]) -> str:
    """One object a bag."""
    return json.dumps([asdict(one) for one in checked], indent=2)


def _check_one(found: Path, path: Path, robot: Robot, names: Mapping[str, str] | None) -> CheckedBag:
    name = Path(os.path.relpath(found, path)).as_posix()
    try:
        info = read_info(found)
    except UserError as error:
        return CheckedBag(name, 0, str(error).removeprefix(f"bag {found}: "), [])
    (reading,) = read_bags([info], robot, names, unlabelled=True)
    notes = list(reading.notes)
    if any(episode.label is None for episode in reading.episodes):
        notes.append(f"{UNLABELLED}: {WITHOUT_LABEL}")
    return CheckedBag(name, len(reading.episodes), _refused(reading), notes)


def _refused(reading: BagReading) -> str | None:
    if reading.refused:
        return "; ".join(reading.refused)
    return None if reading.episodes else "holds no stroke: no rally/outcome ends one"
