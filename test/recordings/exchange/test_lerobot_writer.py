"""Ours writes what LeRobot itself wrote of the same rows: files, names, types, statistics."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest

from lerobot_problem import FEATURES, FPS, LENGTHS, ROBOT, TASKS, episode
from msrd_ros.learning.lerobot_files import LeRobotFiles
from msrd_ros.recordings.exchange.lerobot_writer import LeRobotWriter
from processes import CHECKOUT

THEIRS = CHECKOUT / "test" / "data" / "lerobot"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
DATA = "data/chunk-000/file-000.parquet"
HISTOGRAM_BIN = 1 / 5000
"""Of a feature's range: how exact LeRobot's quantiles are."""


def write(root: Path, **options: float) -> Path:
    """The same episodes by our writer."""
    root.mkdir()
    features = {name: {**told, "shape": list(told["shape"])} for name, told in FEATURES.items()}
    with LeRobotWriter(root, FPS, ROBOT, features, **options) as writer:
        for number, task in enumerate(TASKS):
            writer.add(task, episode(number), {})
    return root


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set that our writer wrote."""
    return write(tmp_path_factory.mktemp("lerobot") / "ours")


def load(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def files(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}


def require_statistics(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> None:
    """Equal but for single precision and the bins of histograms."""
    assert mine.keys() == theirs.keys()
    span = np.maximum(np.subtract(theirs["max"], theirs["min"]), 1e-6)
    for key, value in theirs.items():
        assert np.shape(mine[key]) == np.shape(value)
        exact = HISTOGRAM_BIN if key[0] == "q" else 1e-6
        assert (np.abs(np.subtract(mine[key], value)) <= exact * span).all(), key


def test_there_are_the_same_files(ours: Path) -> None:
    assert files(ours) == files(THEIRS)


def test_info_says_the_same(ours: Path) -> None:
    assert load(ours / "meta" / "info.json") == load(THEIRS / "meta" / "info.json")


def test_rows_are_the_same_in_columns_of_the_same_types(ours: Path) -> None:
    mine, theirs = parquet.read_table(ours / DATA), parquet.read_table(THEIRS / DATA)
    assert mine.schema.equals(theirs.schema)
    assert mine.to_pylist() == theirs.to_pylist()


def test_tasks_are_the_names_of_rows_for_pandas(ours: Path) -> None:
    tables = [parquet.read_table(root / "meta" / "tasks.parquet") for root in (ours, THEIRS)]
    assert tables[0].to_pylist() == tables[1].to_pylist()
    told = [json.loads(table.schema.metadata[b"pandas"]) for table in tables]
    assert told[0]["index_columns"] == told[1]["index_columns"]
    assert [one["field_name"] for one in told[0]["columns"]] == [
        one["field_name"] for one in told[1]["columns"]
    ]


def test_the_table_of_episodes_has_the_same_columns_and_statistics(ours: Path) -> None:
    mine, theirs = parquet.read_table(ours / EPISODES), parquet.read_table(THEIRS / EPISODES)
    assert {one.name: one.type for one in mine.schema} == {one.name: one.type for one in theirs.schema}
    for one, other in zip(mine.to_pylist(), theirs.to_pylist(), strict=True):
        features = {name.split("/")[1] for name in other if name.startswith("stats/")}
        assert features > set(FEATURES)
        for feature in features:
            require_statistics(
                *(
                    {key.split("/")[2]: row[key] for key in row if key.startswith(f"stats/{feature}/")}
                    for row in (one, other)
                )
            )
        assert {key: one[key] for key in one if key[:6] != "stats/"} == {
            key: other[key] for key in other if key[:6] != "stats/"
        }


def test_statistics_of_the_whole_agree(ours: Path) -> None:
    mine, theirs = load(ours / "meta" / "stats.json"), load(THEIRS / "meta" / "stats.json")
    assert mine.keys() == theirs.keys()
    for feature in theirs:
        require_statistics(mine[feature], theirs[feature])


def test_a_full_file_is_followed_by_another(tmp_path: Path) -> None:
    root = write(tmp_path / "small", data_file_mb=1e-4)
    assert {name for name in files(root) if name[:5] == "data/"} == {DATA, DATA.replace("e-000", "e-001")}
    told = parquet.read_table(root / EPISODES).to_pylist()
    assert [one["data/file_index"] for one in told] == [0, 1]
    found = LeRobotFiles.open(root).episodes(FEATURES)
    assert [len(one.rows["action"]) for one in found] == list(LENGTHS)
    assert np.array_equal(found[1].rows["action"], episode(1)["action"])
