"""Writing a LeRobotDataset of version 3, file by file as LeRobot's own code reads it, without LeRobot.

Source: lerobot 0.4.4, `lerobot.datasets.lerobot_dataset` and `lerobot.datasets.utils`: names of files and
columns, their types, and the keys of ``meta/info.json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.lerobot_files import (
    DATA_FOLDER,
    EPISODES_FOLDER,
    INDEX_COLUMN,
    INFO_FILE,
    TASKS_FILE,
    need_pyarrow,
)
from msrd_ros.recordings.exchange.statistics import Statistics, episode_statistics, pooled

CODEBASE_VERSION = "v3.0"
STATISTICS_FILE = "meta/stats.json"
FILE_PATTERN = "chunk-{chunk_index:03d}/file-{file_index:03d}"
VIDEO_PATH = "videos/{video_key}/" + FILE_PATTERN + ".mp4"
FILES_PER_CHUNK = 1000
DATA_FILE_MB, VIDEO_FILE_MB = 100, 200

_OWN_FEATURES = {
    name: {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index")
}
"""What every data set has beside its own features."""


@dataclass(frozen=True)
class EpisodeVideo:
    """Where an episode's pictures are, and what is known of them.

    Attributes
    ----------
    feature
        Its name.
    file_index
        Of the video's files.
    from_s, to_s
        Of that file.
    statistics
        As of `picture_statistics`.
    """

    feature: str
    file_index: int
    from_s: float
    to_s: float
    statistics: Statistics

    def facts(self) -> dict[str, Any]:
        """Columns of the table of episodes."""
        at = f"videos/{self.feature}"
        return {
            f"{at}/chunk_index": self.file_index // FILES_PER_CHUNK,
            f"{at}/file_index": self.file_index % FILES_PER_CHUNK,
            f"{at}/from_timestamp": self.from_s,
            f"{at}/to_timestamp": self.to_s,
        }


@dataclass
class LeRobotWriter:
    """Writes episodes one after the other; the data set is whole when it is left.

    Parameters
    ----------
    root
        Its folder, which exists.
    rate_hz
        Frames a second, a whole number.
    robot_type
        Name of the arm.
    features
        By name: `dtype`, `shape` and `names` as LeRobot has them, and whatever else is to be told.
    data_file_mb
        Size from which rows go into a new file.
    """

    root: Path
    rate_hz: int
    robot_type: str
    features: Mapping[str, Mapping[str, Any]]
    data_file_mb: float = DATA_FILE_MB
    _tasks: dict[str, int] = field(default_factory=dict, init=False)
    _episodes: list[dict[str, Any]] = field(default_factory=list, init=False)
    _statistics: list[dict[str, Statistics]] = field(default_factory=list, init=False)
    _frames: int = field(default=0, init=False)
    _file_index: int = field(default=0, init=False)
    _writer: Any = field(default=None, init=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.close()
        if kind is None:
            self._finish()

    def add(
        self,
        task: str,
        rows: Mapping[str, NDArray[Any]],
        facts: Mapping[str, str | int],
        video: EpisodeVideo | None = None,
    ) -> None:
        """Write an episode.

        Parameters
        ----------
        task
            What it shows, as text.
        rows
            By feature that is no video: shape (T, width).
        facts
            Further columns of the table of episodes, the same in each.
        video
            Of its pictures, where the features have one.
        """
        length, number = len(next(iter(rows.values()))), len(self._episodes)
        steps = np.arange(length)
        whole = {
            **rows,
            "timestamp": (steps / self.rate_hz).astype(np.float32)[:, None],
            "frame_index": steps[:, None],
            "episode_index": np.full((length, 1), number),
            "index": (self._frames + steps)[:, None],
            "task_index": np.full((length, 1), self._tasks.setdefault(task, len(self._tasks))),
        }
        statistics = {name: episode_statistics(values) for name, values in whole.items()}
        if video is not None:
            statistics[video.feature] = video.statistics
        self._write_rows(whole)
        self._statistics.append(statistics)
        self._episodes.append(
            {
                "episode_index": number,
                "tasks": [task],
                "length": length,
                "data/chunk_index": self._file_index // FILES_PER_CHUNK,
                "data/file_index": self._file_index % FILES_PER_CHUNK,
                "dataset_from_index": self._frames,
                "dataset_to_index": self._frames + length,
                **({} if video is None else video.facts()),
                **facts,
                **{
                    f"stats/{name}/{key}": value.tolist()
                    for name, one in statistics.items()
                    for key, value in one.items()
                },
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        self._frames += length

    def _write_rows(self, rows: Mapping[str, NDArray[Any]]) -> None:
        arrow = need_pyarrow()
        columns = {}
        for name, values in rows.items():
            flat = arrow.array(np.ascontiguousarray(values).reshape(-1))
            # One number a row is a plain column, and more are a list of a fixed length.
            columns[name] = (
                flat if values.shape[1] == 1 else arrow.FixedSizeListArray.from_arrays(flat, values.shape[1])
            )
        table = arrow.table(columns)
        if self._writer is not None and self._path().stat().st_size >= self.data_file_mb * 2**20:
            self._writer.close()
            self._writer, self._file_index = None, self._file_index + 1
        if self._writer is None:
            self._path().parent.mkdir(parents=True, exist_ok=True)
            self._writer = arrow.parquet.ParquetWriter(self._path(), table.schema)
        self._writer.write_table(table)

    def _path(self) -> Path:
        return self.root / DATA_FOLDER / f"{numbered(self._file_index)}.parquet"

    def _finish(self) -> None:
        arrow = need_pyarrow()
        episodes = self.root / EPISODES_FOLDER / f"{numbered(0)}.parquet"
        episodes.parent.mkdir(parents=True)
        arrow.parquet.write_table(arrow.Table.from_pylist(self._episodes), episodes)
        arrow.parquet.write_table(_task_table(arrow, self._tasks), self.root / TASKS_FILE)
        names = self._statistics[0]
        statistics = {name: pooled([one[name] for one in self._statistics]) for name in names}
        self._write_json(
            STATISTICS_FILE,
            {name: {key: value.tolist() for key, value in one.items()} for name, one in statistics.items()},
        )
        count = len(self._episodes)
        moving = any(feature["dtype"] == "video" for feature in self.features.values())
        self._write_json(
            INFO_FILE,
            {
                "codebase_version": CODEBASE_VERSION,
                "robot_type": self.robot_type,
                "total_episodes": count,
                "total_frames": self._frames,
                "total_tasks": len(self._tasks),
                "chunks_size": FILES_PER_CHUNK,
                "data_files_size_in_mb": DATA_FILE_MB,
                "video_files_size_in_mb": VIDEO_FILE_MB,
                "fps": self.rate_hz,
                "splits": {"train": f"0:{count}"},
                "data_path": f"{DATA_FOLDER}/{FILE_PATTERN}.parquet",
                "video_path": VIDEO_PATH if moving else None,
                "features": {**self.features, **_OWN_FEATURES},
            },
        )

    def _write_json(self, name: str, content: Mapping[str, Any]) -> None:
        (self.root / name).write_text(json.dumps(content, indent=4) + "\n", encoding="utf-8")


def numbered(file_index: int) -> str:
    """Chunk and file of the data set's n-th file of a kind, without its suffix."""
    return FILE_PATTERN.format(
        chunk_index=file_index // FILES_PER_CHUNK, file_index=file_index % FILES_PER_CHUNK
    )


def _task_table(arrow: Any, tasks: Mapping[str, int]) -> Any:
    """Numbers by text, which pandas takes for the rows' names."""
    table = arrow.table(
        {"task_index": arrow.array(list(tasks.values()), arrow.int64()), INDEX_COLUMN: list(tasks)}
    )

    def column(name: str | None, stored: str, kind: str, numpy_kind: str) -> dict[str, str | None]:
        return {
            "name": name,
            "field_name": stored,
            "pandas_type": kind,
            "numpy_type": numpy_kind,
            "metadata": None,
        }

    pandas = {
        "index_columns": [INDEX_COLUMN],
        "column_indexes": [],
        "columns": [
            column("task_index", "task_index", "int64", "int64"),
            column(None, INDEX_COLUMN, "unicode", "object"),
        ],
    }
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})
