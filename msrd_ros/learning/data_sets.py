"""Demonstrations from data sets of Minari and LeRobot on this machine, whoever recorded them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.lerobot_files import LeRobotEpisode, LeRobotFiles
from msrd_ros.learning.trajectories import Demonstrations

if TYPE_CHECKING:
    import minari


def demonstrations_from_minari(
    dataset: str | minari.MinariDataset,
    label: str | Callable[[Any], str] = "label",
    observation_names: Sequence[str] = (),
    action_names: Sequence[str] = (),
    control_period_s: float = 1.0,
) -> Demonstrations:
    """Demonstrations from a Minari data set on this machine.

    Parameters
    ----------
    dataset
        The data set or its name.
    label
        Key of an episode's ``infos`` that holds its strategy (text, the same in every step), or a function
        of the episode. Where that is empty the strategy is not known.
    observation_names, action_names, control_period_s
        As of `demonstrations_from_arrays`; dictionaries of observations are flattened.

    Raises
    ------
    UserError
        If there is no such data set, Minari is not installed, an episode has no label, and as
        `demonstrations_from_arrays`.
    """
    try:
        import minari
        from gymnasium import spaces
    except ImportError as error:
        raise UserError(f"{error.name} is not installed; pip install 'msrd_ros[minari]'") from None
    if isinstance(dataset, str):
        try:
            dataset = minari.load_dataset(dataset)
        except (FileNotFoundError, ValueError) as error:
            raise UserError(f"Minari data set {dataset!r}: {error}") from None
    observation_space, action_space = dataset.observation_space, dataset.action_space
    episodes = list(dataset.iterate_episodes())
    return demonstrations_from_arrays(
        [_flat(spaces, observation_space, episode.observations) for episode in episodes],
        [_flat(spaces, action_space, episode.actions) for episode in episodes],
        [label(episode) if callable(label) else _info_label(episode, label) for episode in episodes],
        [bool(episode.terminations[-1]) for episode in episodes],
        observation_names,
        action_names,
        control_period_s,
    )


def demonstrations_from_lerobot(
    folder: Path | str,
    label: str | Callable[[LeRobotEpisode], str | None] = "task",
    observations: Sequence[str] = (),
    action: str = "action",
    terminated: bool = False,
) -> Demonstrations:
    """Demonstrations from a LeRobotDataset of version 3 on this machine, of any arm; pictures are left out.

    An episode has as many rows of actions as of observations, so its last action is left out: what it led to
    was not recorded.

    Parameters
    ----------
    folder
        Which holds ``meta/`` and ``data/``.
    label
        What tells an episode's strategy: ``task``, a column of the table of episodes, or a function of the
        episode. Where that is empty the strategy is not known.
    observations
        Features that are seen, put together in this order; all rows of numbers called ``observation...`` if
        empty.
    action
        The feature that was done.
    terminated
        Whether episodes ended where their rows do, rather than being cut off.

    Raises
    ------
    UserError
        If it is no such data set, there is no such feature or label, pyarrow is not installed, and as
        `demonstrations_from_arrays`.
    """
    files = LeRobotFiles.open(Path(folder))
    seen = list(observations) or files.numbers("observation")
    if not seen:
        raise UserError(
            f"LeRobot data set {folder}: no row of numbers is called observation...; name the features "
            "that are seen with observations="
        )
    episodes = files.episodes([*seen, action])
    return demonstrations_from_arrays(
        [np.concatenate([episode.rows[name] for name in seen], axis=1) for episode in episodes],
        [episode.rows[action][:-1] for episode in episodes],
        [_told(episode, label, folder) for episode in episodes],
        terminated,
        [name for feature in seen for name in _entries(files, feature, len(seen) > 1)],
        _entries(files, action, False),
        1.0 / files.rate_hz,
    )


def _told(
    episode: LeRobotEpisode, label: str | Callable[[LeRobotEpisode], str | None], folder: Path | str
) -> str | None:
    """The strategy of an episode; None if it is not known."""
    if callable(label):
        return label(episode)
    facts = {**episode.facts, "task": episode.task}
    if label not in facts:
        raise UserError(
            f"LeRobot data set {folder}: its table of episodes has no column {label!r} (there: "
            f"{', '.join(facts)}); say label=COLUMN or a function"
        )
    return str(facts[label] or "") or None


def _entries(files: LeRobotFiles, feature: str, qualified: bool) -> list[str]:
    """Names of a feature's entries, with the feature's own where several are put together."""
    names = files.entry_names(feature)
    if names is None:
        (width,) = files.features[feature]["shape"]
        return [f"{feature}_{index}" for index in range(width)]
    return [f"{feature}.{name}" for name in names] if qualified else names


def _info_label(episode: Any, key: str) -> str | None:
    infos = episode.infos or {}
    if key not in infos:
        known = ", ".join(infos) or "none"
        raise UserError(
            f"episode {episode.id}: no label {key!r} in its infos (there: {known}); say label=KEY or a "
            "function"
        )
    value = np.ravel(np.asarray(infos[key]))[0]
    return (value.decode() if isinstance(value, bytes) else str(value)) or None


def _flat(spaces: Any, space: Any, values: Any) -> NDArray[np.float64]:
    """Dictionaries and several axes to columns, in the order of Gymnasium's `flatten`."""
    if isinstance(space, spaces.Dict):
        parts = [_flat(spaces, part, values[key]) for key, part in space.spaces.items()]
        return np.concatenate(parts, axis=1)
    if isinstance(space, spaces.Tuple):
        parts = [_flat(spaces, part, value) for part, value in zip(space.spaces, values, strict=True)]
        return np.concatenate(parts, axis=1)
    if isinstance(space, spaces.Discrete):
        return np.eye(int(space.n))[np.asarray(values, dtype=np.int64) - int(space.start)]
    array = np.asarray(values, dtype=np.float64)
    return array.reshape(len(array), -1)
