"""Strokes as a Minari data set, and its rows on the way back.

Minari's rows have no names: columns of observations are joint positions, ball position and ball velocity, in
this order, as ``msrd_ros/contract.yaml`` within the data set says by numbers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros import __version__
from msrd_ros.contract.columns import (
    ACTION,
    ENVIRONMENT_STATE,
    JOINT_VELOCITY,
    STATE,
    Columns,
    DataContract,
    stroke_contract,
)
from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.stroke_set import SetStroke, StrokeSet
from msrd_ros.recordings.exchange.table import Table, TableEpisode
from msrd_ros.robots.robot import Robot

OBSERVATIONS, ACTIONS, INFOS = "observations", "actions", "infos"
LABEL = "label"
"""Key of the infos with the strategy: what `demonstrations_from_minari` looks for."""
DATA_FOLDER = "data"
_NAME = re.compile(r"[-_\w]+-v\d+")


def minari_contract(robot: Robot) -> DataContract:
    """`stroke_contract` with Minari's features, whose entries have numbers instead of names."""
    contract = stroke_contract(robot)
    count = robot.joint_count
    begins = {
        STATE: (OBSERVATIONS, 0),
        ENVIRONMENT_STATE: (OBSERVATIONS, count),
        ACTION: (ACTIONS, 0),
        JOINT_VELOCITY: (f"{INFOS}.{JOINT_VELOCITY}", 0),
    }
    found: list[Columns] = []
    for columns in contract.columns:
        feature, begin = begins[columns.feature]
        begins[columns.feature] = feature, begin + len(columns.entries)
        entries = tuple(range(begin, begin + len(columns.entries)))
        found.append(replace(columns, feature=feature, entries=entries))
    return replace(contract, columns=tuple(found))


def write_minari(root: Path, strokes: StrokeSet, name: str, video: bool = False) -> None:
    """Write a Minari data set: double precision, one observation more than actions, all bits of the strokes.

    Rewards are 0, because Minari wants some: nobody has given any.

    Parameters
    ----------
    root
        Its folder, which exists and is empty.
    strokes
        What it shows.
    name
        Of the data set, with its version.
    video
        Refused.

    Raises
    ------
    UserError
        If the name is none of Minari's, pictures are wanted, or Minari is not installed.
    """
    if video:
        raise UserError(
            f"{name}: a Minari data set holds numbers alone; leave out --video, or use --to lerobot"
        )
    minari, spaces = _need_minari()
    if not _NAME.fullmatch(name):
        raise UserError(
            f"{name}: is no name of a Minari data set; end OUT in a name with a version, as strokes-v0"
        )
    width = strokes.strokes[0].episode.observations.shape[1]
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

    storage = MinariStorage.new(
        root / DATA_FOLDER,
        observation_space=spaces.Box(-np.inf, np.inf, (width,), np.float64),
        action_space=spaces.Box(-1.0, 1.0, (strokes.robot.joint_count,), np.float64),
    )
    storage.update_metadata(
        {
            "dataset_id": name,
            "minari_version": minari.__version__,
            "algorithm_name": "demonstrations by hand",
            "description": f"Strokes of {strokes.robot.name}, without rewards; see msrd_ros/contract.yaml",
            "requirements": [f"msrd_ros=={__version__}"],
        }
    )
    storage.update_episodes(
        EpisodeBuffer(
            observations=episode.observations,
            actions=episode.actions,
            rewards=np.zeros(len(episode.actions)),
            terminations=np.zeros(len(episode.actions), dtype=bool),
            truncations=np.arange(len(episode.actions)) == len(episode.actions) - 1,
            infos=_infos(stroke),
        )
        for stroke in strokes.strokes
        for episode in [stroke.episode]
    )


def read_minari(root: Path) -> Table:
    """A Minari data set by its folder, whoever wrote it.

    Raises
    ------
    UserError
        If it is none, or Minari is not installed.
    """
    minari, _ = _need_minari()
    try:
        dataset = minari.MinariDataset(root / DATA_FOLDER)
        return _MinariTable(root, dataset)
    except (OSError, ValueError, KeyError, AssertionError, StopIteration, ImportError) as error:
        raise UserError(
            f"Minari data set {root}: is not readable ({error}); give the folder that holds {DATA_FOLDER}/"
        ) from None


class _MinariTable(Table):
    def __init__(self, root: Path, dataset: Any) -> None:
        self.where = f"Minari data set {root}"
        self.rate_hz: float | None = None
        self._dataset = dataset
        first = next(iter(dataset.iterate_episodes()))
        found: dict[str, Any] = {ACTIONS: first.actions}
        for kind, parts in ((OBSERVATIONS, first.observations), (INFOS, first.infos or {})):
            found |= (
                {f"{kind}.{key}": part for key, part in parts.items()}
                if isinstance(parts, dict)
                else {kind: parts}
            )
        self._widths = {
            name: part.shape[1]
            for name, part in found.items()
            if isinstance(part, np.ndarray) and part.ndim == 2 and part.dtype.kind in "fiub"
        }

    def entry_names(self, feature: str) -> list[str] | None:
        self.width(feature)
        return None

    def width(self, feature: str) -> int:
        if feature not in self._widths:
            raise UserError(
                f"{self.where}: there is no feature {feature!r} that is a row of numbers; there are "
                f"{', '.join(self._widths) or 'none'}"
            )
        return int(self._widths[feature])

    def episodes(self, features: list[str]) -> list[TableEpisode]:
        found = []
        for episode in self._dataset.iterate_episodes():
            rows = {name: _rows(episode, name) for name in features}
            facts = {key: _first(values) for key, values in (episode.infos or {}).items()}
            found.append(TableEpisode(int(episode.id), str(facts.get(LABEL, "")), rows, facts))
        return found

    def of_stroke(self, episode: Episode) -> Mapping[str, NDArray[Any]]:
        return {
            OBSERVATIONS: episode.observations,
            ACTIONS: episode.actions,
            f"{INFOS}.{JOINT_VELOCITY}": episode.joint_velocity,
        }


def _need_minari() -> tuple[Any, Any]:
    try:
        import minari
        from gymnasium import spaces
    except ImportError as error:
        raise UserError(f"{error.name} is not installed; pip install 'msrd_ros[minari]'") from None
    return minari, spaces


def _infos(stroke: SetStroke) -> dict[str, NDArray[Any]]:
    """What is said of a stroke, in every step: Minari's own tools keep infos and drop all else.

    Text is of a fixed length, which they can copy.
    """
    said = {
        key: np.array(
            [value.encode() if isinstance(value, str) else value] * len(stroke.episode.observations)
        )
        for key, value in stroke.facts().items()
    }
    return {**said, JOINT_VELOCITY: stroke.episode.joint_velocity}


def _first(values: Any) -> Any:
    """What an info says at the first step; None where that is nested."""
    if isinstance(values, Mapping) or not np.size(values):
        return None
    value = np.ravel(np.asarray(values))[0]
    return value.decode() if isinstance(value, bytes) else value


def _rows(episode: Any, feature: str) -> NDArray[Any]:
    kind, _, key = feature.partition(".")
    values = getattr(episode, kind)
    return np.asarray(values[key] if key else values)
