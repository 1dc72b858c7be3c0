"""Reading the files of a LeRobotDataset of version 3, without LeRobot: its numbers, tasks and episodes.

Source: lerobot 0.4.4, `lerobot.datasets.lerobot_dataset`. Rows of all episodes lie in parquet files of
``data/``, one row a frame; ``meta/info.json`` names the features and the rate.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError

INFO_FILE, TASKS_FILE, EPISODES_FOLDER, DATA_FOLDER = (
    "meta/info.json",
    "meta/tasks.parquet",
    "meta/episodes",
    "data",
)
INDEX_COLUMN = "__index_level_0__"
"""Where pandas keeps the tasks' texts, which are the rows' names."""
PICTURES = ("image", "video")
_LFS_POINTER = b"version https://git-lfs"


@dataclass(frozen=True)
class LeRobotEpisode:
    """One episode.

    Attributes
    ----------
    number
        In the data set.
    task
        Its text; of several, the first.
    rows
        By feature: shape (T, width), in the data set's own type.
    facts
        What the table of episodes says besides; statistics left out.
    """

    number: int
    task: str
    rows: Mapping[str, NDArray[Any]]
    facts: Mapping[str, Any]


@dataclass(frozen=True)
class LeRobotFiles:
    """What a data set says of itself.

    Attributes
    ----------
    root
        Its folder.
    rate_hz
        Frames a second.
    features
        By name, as ``meta/info.json`` says: `dtype`, `shape`, `names`.
    """

    root: Path
    rate_hz: float
    features: Mapping[str, Mapping[str, Any]]

    @classmethod
    def open(cls, root: Path) -> LeRobotFiles:
        """Read ``meta/info.json``.

        Raises
        ------
        UserError
            If it is none of a LeRobotDataset of version 3; says what to do.
        """
        where = f"LeRobot data set {root}"
        try:
            info = json.loads((root / INFO_FILE).read_text(encoding="utf-8"))
            version, rate_hz, features = (
                str(info["codebase_version"]),
                float(info["fps"]),
                dict(info["features"]),
            )
            shapes = [tuple(map(int, feature["shape"])) for feature in features.values()]
            if not 0.0 < rate_hz < math.inf:
                raise ValueError(f"fps is {rate_hz:g}")
            kinds = [str(feature["dtype"]) for feature in features.values()]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise UserError(
                f"{where}: {INFO_FILE} is not readable ({type(error).__name__}: {error}); give the folder "
                "that holds meta/ and data/"
            ) from None
        if not version.removeprefix("v").startswith("3."):
            raise UserError(
                f"{where}: is of version {version}, and v3.x is read; convert it with LeRobot's "
                "lerobot.datasets.v30.convert_dataset_v21_to_v30"
            )
        told = {
            name: {**feature, "shape": shape, "dtype": kind}
            for (name, feature), shape, kind in zip(features.items(), shapes, kinds, strict=True)
        }
        return cls(root, rate_hz, told)

    def entry_names(self, feature: str) -> list[str] | None:
        """Names of a feature's entries; None where the data set has none.

        Raises
        ------
        UserError
            If there is no such feature, or it is no row of numbers.
        """
        self.require(feature)
        names = self.features[feature].get("names")
        if isinstance(names, Mapping) and len(names) == 1:  # earlier writers: {"motors": [...]}
            names = next(iter(names.values()))
        (width,) = self.features[feature]["shape"]
        return [str(name) for name in names] if isinstance(names, list) and len(names) == width else None

    def numbers(self, begin: str) -> list[str]:
        """Features that are rows of numbers and whose names begin so."""
        return [name for name, told in self.features.items() if name.startswith(begin) and _is_row(told)]

    def require(self, feature: str) -> None:
        """Refuse a feature that is not there or is no row of numbers.

        Raises
        ------
        UserError
            Says which there are.
        """
        told = self.features.get(feature)
        if told is None or not _is_row(told):
            state = (
                "there is no"
                if told is None
                else f"{told['dtype']} of shape {told['shape']} is no row of numbers:"
            )
            raise UserError(
                f"LeRobot data set {self.root}: {state} feature {feature!r}; there are "
                f"{', '.join(self.numbers(''))}"
            )

    def episodes(self, features: Iterable[str]) -> list[LeRobotEpisode]:
        """All episodes, with the rows of some features.

        Raises
        ------
        UserError
            If a file is missing or damaged, rows are not those that the table of episodes tells of, or
            pyarrow is not installed.
        """
        wanted = list(dict.fromkeys(features))
        for feature in wanted:
            self.require(feature)
        tasks = self._tasks()
        told = [row for file in self._files(EPISODES_FOLDER) for row in _read(file).to_pylist()]
        tables = [_read(file, [*wanted, "episode_index", "task_index"]) for file in self._files(DATA_FOLDER)]
        numbers = np.concatenate([table["episode_index"].to_numpy() for table in tables])
        task_of = np.concatenate([table["task_index"].to_numpy() for table in tables])
        rows = {name: np.concatenate([self._numbers(table, name) for table in tables]) for name in wanted}
        found = []
        for facts in sorted(told, key=lambda row: int(row["episode_index"])):
            number = int(facts["episode_index"])
            mine = np.flatnonzero(numbers == number)
            if len(mine) != int(facts["length"]) or not len(mine):
                raise UserError(
                    f"LeRobot data set {self.root}: episode {number} has {len(mine)} rows, and "
                    f"{facts['length']} are told; copy the data set again"
                )
            task = int(task_of[mine[0]])
            if task not in tasks:
                raise UserError(
                    f"LeRobot data set {self.root}: {TASKS_FILE} lacks task {task}; copy it again"
                )
            kept = {name: value for name, value in facts.items() if not name.startswith("stats/")}
            found.append(
                LeRobotEpisode(number, tasks[task], {name: part[mine] for name, part in rows.items()}, kept)
            )
        return found

    def _numbers(self, table: Any, feature: str) -> NDArray[Any]:
        (width,) = self.features[feature]["shape"]
        return _matrix(table[feature], width, f"LeRobot data set {self.root}: {feature}")

    def _tasks(self) -> dict[int, str]:
        table = _read(self.root / TASKS_FILE)
        texts = [name for name in table.column_names if name != "task_index"]
        if not texts or "task_index" not in table.column_names:
            raise UserError(f"LeRobot data set {self.root}: {TASKS_FILE} holds no tasks; copy it again")
        column = INDEX_COLUMN if INDEX_COLUMN in texts else texts[0]
        return dict(zip(table["task_index"].to_pylist(), map(str, table[column].to_pylist()), strict=True))

    def _files(self, folder: str) -> list[Path]:
        files = sorted((self.root / folder).glob("*/*.parquet"))
        if not files:
            raise UserError(f"LeRobot data set {self.root}: {folder}/ holds no parquet file; copy it again")
        return files


def _is_row(feature: Mapping[str, Any]) -> bool:
    return len(feature["shape"]) == 1 and feature["dtype"] not in (*PICTURES, "string")


def need_pyarrow() -> Any:
    """The library that reads and writes parquet files.

    Raises
    ------
    UserError
        If it is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise UserError(f"{error.name} is not installed; pip install 'msrd_ros[lerobot]'") from None
    return pyarrow


def _read(file: Path, columns: list[str] | None = None) -> Any:
    arrow = need_pyarrow()
    try:
        with file.open("rb") as stream:
            head = stream.read(len(_LFS_POINTER))
        if head == _LFS_POINTER:
            raise UserError(f"{file}: is a pointer of Git LFS, not the file; run: git lfs pull")
        return arrow.parquet.read_table(file, columns=columns)
    except (OSError, arrow.ArrowException, KeyError) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise UserError(f"{file}: is not readable ({reason}); copy the data set again") from None


def _matrix(column: Any, width: int, where: str) -> NDArray[Any]:
    """A column of numbers, or of equally long lists of numbers, as shape (rows, width)."""
    lists = hasattr(column.type, "value_type")
    chunks = [np.asarray(chunk.flatten() if lists else chunk) for chunk in column.chunks if len(chunk)]
    flat = np.concatenate(chunks) if chunks else np.zeros(0)
    if flat.size != len(column) * width or flat.dtype.kind not in "fiub":
        raise UserError(f"{where}: rows are not {width} numbers each, as {INFO_FILE} says; copy it again")
    return flat.reshape(len(column), width)
