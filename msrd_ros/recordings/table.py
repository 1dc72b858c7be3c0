"""A folder of bags as a table: one row a stroke, with what is known of it and how it stands out."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from msrd_ros.bags.finding import find_bags
from msrd_ros.bags.info import read_info
from msrd_ros.bags.lone_mcap import MCAP_SUFFIX
from msrd_ros.bags.metadata import NOTE_KEY
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import UNLABELLED
from msrd_ros.contract.topics import OUTCOME
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import cut_bag
from msrd_ros.recordings.history import History, find_library
from msrd_ros.recordings.outliers import OutlierLimits, deviations, distances, path_of, rms_jerk
from msrd_ros.recordings.row import ACCEPTED, Measured, Row, measure
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot

_Signature = tuple[object, ...]
"""Of a bag's files: as long as it is the same, so are they."""


def rows(
    folder: Path | str,
    robot: Robot | None = None,
    names: Mapping[str, str] | None = None,
    discarded: bool = False,
) -> list[Row]:
    """The strokes of a folder, read once; see `StrokeTable`."""
    return StrokeTable(folder, robot, names).rows(discarded)


class StrokeTable:
    """The strokes of a folder; a bag that has not changed is read once.

    Parameters
    ----------
    folder
        Of bags; or one bag, or an MCAP file.
    robot
        The arm that was led; the default one if None.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.
    limits
        From where on a stroke is marked as an outlier.

    Attributes
    ----------
    notes
        What the last call brought to its end after a crash.

    Raises
    ------
    UserError
        If there is no such folder.
    """

    def __init__(
        self,
        folder: Path | str,
        robot: Robot | None = None,
        names: Mapping[str, str] | None = None,
        limits: OutlierLimits | None = None,
    ) -> None:
        self._folder = Path(folder)
        if not self._folder.is_dir() and self._folder.suffix != MCAP_SUFFIX:
            state = "is a file" if self._folder.exists() else "does not exist"
            raise UserError(f"folder {folder}: {state}; give a folder of bags, a bag or an MCAP file")
        self._robot, self._names = robot or default_robot(), names
        self._limits = limits or OutlierLimits()
        self._known: dict[_Signature, list[Measured]] = {}
        self.notes: list[str] = []

    def rows(self, discarded: bool = False) -> list[Row]:
        """All strokes, in the order of their paths; with `discarded` those that are set aside as well.

        What is discarded is compared with the others, but none of the others with it.
        """
        known, self._known = self._known, {}
        library = find_library(self._folder)
        history = None if library is None else History(library)
        self.notes = _mend(history)
        flags = {} if history is None else history.flags()
        places = [(path, "") for path in find_bags(self._folder)]
        if history is not None and discarded:
            places += [
                (history.folder / bag, home)
                for bag, home in history.discarded().items()
                if (history.folder / home).is_relative_to(self._folder.resolve())
            ]
        measured = []
        for path, home in places:
            try:
                key = _signature(path)
            except FileNotFoundError:
                continue  # somebody has just moved it
            self._known[key] = known[key] if key in known else self._read(path)
            told = flags.get(os.path.relpath(path.resolve(), library), ()) if library is not None else ()
            measured += [
                one._replace(row=replace(one.row, flags=(*one.row.flags, *told), discarded=home))
                for one in self._known[key]
            ]
        return self._compared(measured)

    def _read(self, path: Path) -> list[Measured]:
        name = os.path.relpath(path.absolute(), self._folder.absolute())
        row = Row(Path(name).as_posix())
        try:
            info = read_info(path)
            note = info.custom_data.get(NOTE_KEY)
            label = UNLABELLED if info.unlabelled else str(info.label or "")
            row = replace(row, subject=info.subject, label=label, flags=(note,) if note else ())
            row = replace(row, length_s=info.duration_ns / 1e9)
            strokes, origin, _ = cut_bag(Bag(path, self._names), self._robot)
        except UserError as error:
            return [Measured(replace(row, detail=str(error).removeprefix(f"bag {path}: ")), None, {})]
        if not strokes:
            return [Measured(replace(row, detail=f"holds no stroke: no {OUTCOME} ends one"), None, {})]
        return [measure(stroke, row, info, self._robot, origin) for stroke in strokes]

    def _compared(self, measured: list[Measured]) -> list[Row]:
        """The rows with what the comparison with the others of their label tells."""
        found = [replace(one.row, marks=tuple(_missing(one, self._limits))) for one in measured]
        groups = defaultdict(list)
        for number, one in enumerate(measured):
            if one.episode is not None:
                groups[one.row.label].append(number)
        for numbers in groups.values():
            episodes = [episode for number in numbers if (episode := measured[number].episode) is not None]
            among = [
                place
                for place, number in enumerate(numbers)
                # Strokes without a label may be of any strategy: none is held against the others.
                if found[number].verdict == ACCEPTED
                and not found[number].discarded
                and found[number].label != UNLABELLED
            ]
            jerk = np.array([rms_jerk(episode) for episode in episodes])
            apart = distances([path_of(episode) for episode in episodes], among)
            scores = deviations(jerk, among, self._limits), deviations(apart, among, self._limits)
            for place, number in enumerate(numbers):
                marks = list(found[number].marks)
                for value, unit, score in (
                    (jerk, "rad/s^3 of jerk", scores[0]),
                    (apart, "rad away", scores[1]),
                ):
                    if score[place] > self._limits.deviation:
                        marks.append(
                            f"{value[place]:.4g} {unit}, {score[place]:.1f} deviations above the others"
                        )
                found[number] = replace(
                    found[number],
                    jerk_rad_s3=float(jerk[place]),
                    distance_rad=_known(float(apart[place])),
                    marks=tuple(marks),
                )
        return found


def _mend(history: History | None) -> list[str]:
    try:
        return [] if history is None else history.mend()
    except UserError as error:
        return [str(error)]  # a folder that cannot be written can still be read


def _signature(path: Path) -> _Signature:
    files = [path] if path.is_file() else sorted(path.iterdir())
    facts = [file.lstat() for file in files]
    return (str(path), *((one.st_ino, one.st_size, one.st_mtime_ns) for one in facts))


def _missing(one: Measured, limits: OutlierLimits) -> Iterator[str]:
    for topic, (missing, whole) in one.missed.items():
        if missing > limits.missed_share * whole:
            yield f"{missing} of {whole} samples of {topic} are missing"


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
