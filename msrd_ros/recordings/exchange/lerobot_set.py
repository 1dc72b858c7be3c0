"""Strokes as a LeRobotDataset, and its rows on the way back."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from msrd_ros.contract.columns import DataContract, stroke_contract
from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.contract.labels import say_label
from msrd_ros.learning.lerobot_files import LeRobotFiles
from msrd_ros.recordings.exchange.film import Film
from msrd_ros.recordings.exchange.lerobot_writer import LeRobotWriter
from msrd_ros.recordings.exchange.stroke_set import StrokeSet, state_rows
from msrd_ros.recordings.exchange.table import Table, TableEpisode


def write_lerobot(root: Path, strokes: StrokeSet, name: str, video: bool) -> None:
    """Write a LeRobotDataset of version 3.

    Parameters
    ----------
    root
        Its folder, which exists and is empty.
    strokes
        What it shows.
    name
        Of the data set, which does not say it itself.
    video
        Draw the simulator's picture of every row: from recorded joints and ball, not of a camera.
    """
    contract = stroke_contract(strokes.robot)
    rate_hz = round(1.0 / CONTROL_PERIOD_S)
    features = {key: _feature(contract, key) for key in stroke_rows(strokes.strokes[0].episode)}
    with ExitStack() as stack:
        film: Film | None = None
        if video:
            film = stack.enter_context(Film(root, strokes.robot, rate_hz))
            features[film.feature] = film.description
        writer = stack.enter_context(LeRobotWriter(root, rate_hz, strokes.robot.name, features))
        for stroke in tqdm(strokes.strokes, "strokes drawn", disable=not video):
            shown = film.add(stroke.episode) if film is not None else None
            writer.add(say_label(stroke.episode.label), stroke_rows(stroke.episode), stroke.facts(), shown)


def stroke_rows(episode: Episode) -> dict[str, NDArray[np.float32]]:
    """`state_rows` in single precision, which LeRobot's policies compute in."""
    return {name: values.astype(np.float32) for name, values in state_rows(episode).items()}


def read_lerobot(root: Path) -> Table:
    """A LeRobotDataset of version 3, whoever wrote it.

    Raises
    ------
    UserError
        If it is none; says what to do.
    """
    files = LeRobotFiles.open(root)
    return _LeRobotTable(files)


class _LeRobotTable(Table):
    def __init__(self, files: LeRobotFiles) -> None:
        self._files = files
        self.where = f"LeRobot data set {files.root}"
        self.rate_hz: float | None = files.rate_hz

    def entry_names(self, feature: str) -> list[str] | None:
        return self._files.entry_names(feature)

    def width(self, feature: str) -> int:
        self._files.require(feature)
        return int(self._files.features[feature]["shape"][0])

    def episodes(self, features: list[str]) -> list[TableEpisode]:
        return [
            TableEpisode(one.number, one.task, one.rows, one.facts) for one in self._files.episodes(features)
        ]

    def of_stroke(self, episode: Episode) -> Mapping[str, NDArray[Any]]:
        return stroke_rows(episode)


def _feature(contract: DataContract, name: str) -> dict[str, Any]:
    parts = [columns for columns in contract.columns if columns.feature == name]
    names = [entry for columns in parts for entry in columns.entries]
    units = [columns.unit for columns in parts for _ in columns.entries]
    return {"dtype": "float32", "shape": [len(names)], "names": names, "units": units}
