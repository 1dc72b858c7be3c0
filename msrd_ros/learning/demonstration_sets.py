"""Demonstrations from arrays, checked before anything is learned from them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.alignment import better_shift
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.trajectories import NO_LABEL, Demonstrations

ROOM_AFTER_THE_LAST = 1.25
"""Where episodes end, the horizon over the longest demonstration: so that every end is seen from behind."""


def demonstrations_from_arrays(
    observations: Sequence[ArrayLike],
    actions: Sequence[ArrayLike],
    labels: Sequence[str | None] | None,
    terminated: bool | Sequence[bool] | None = None,
    observation_names: Sequence[str] = (),
    action_names: Sequence[str] = (),
    control_period_s: float = 1.0,
) -> Demonstrations:
    """Demonstrations of any lengths, one entry of each list a trajectory.

    Parameters
    ----------
    observations
        ``[T+1, O]`` each: what was seen before every action, and after the last one.
    actions
        ``[T, A]`` each, in the environment's own units.
    labels
        Whose strategy each trajectory is; strategies are numbered as they first appear. None, for all or for
        each: not known, and to be found by training with ``labels="discover"``.
    terminated
        Whether the episodes ended where the trajectories do (landed, fallen, done) rather than being cut
        off; for all or for each. May be left out where all are equally long: then they were cut off.
    observation_names, action_names
        Names of the columns; empty: numbered. Names have to be the environment's.
    control_period_s
        Seconds between two actions, for whoever plays the policies on a clock.

    Raises
    ------
    UserError
        Naming the trajectory and what is wrong with it.

    Warns
    -----
    UserWarning
        If actions seem to stand beside other observations than those they were taken at, or a strategy has
        one demonstration only.
    """
    if labels is None:
        labels = [None] * len(observations)
    if not len(observations) == len(actions) == len(labels):
        raise UserError(
            f"demonstrations: {len(observations)} arrays of observations, {len(actions)} of actions, "
            f"{len(labels)} labels; give one of each for every trajectory"
        )
    if not len(labels):
        raise UserError("demonstrations: there are none")
    seen = [_table(f"observations of trajectory {n}", array) for n, array in enumerate(observations)]
    done = [_table(f"actions of trajectory {n}", array) for n, array in enumerate(actions)]
    _require_labels(labels)
    _require_lengths(seen, done)
    names = tuple(observation_names) or _numbered("observation", seen[0].shape[1])
    action_columns = tuple(action_names) or _numbered("action", done[0].shape[1])
    _require_columns("observation", seen, names)
    _require_columns("action", done, action_columns)
    ended = _endings(terminated, done)
    shift = better_shift(list(zip(seen, done, strict=True)))
    if shift:
        warnings.warn(_shift_text(shift), stacklevel=2)
    known = [NO_LABEL if label is None else label for label in labels]
    return _stack(seen, done, known, ended, names, action_columns, control_period_s)


def _table(what: str, array: ArrayLike) -> NDArray[np.float64]:
    try:
        table = np.asarray(array, dtype=np.float64)
    except (ValueError, TypeError):
        raise UserError(
            f"{what}: rows differ in length or are no numbers; give an array of two axes"
        ) from None
    if table.ndim != 2 or not table.size:
        raise UserError(f"{what}: shape {table.shape}; give [steps, columns]")
    bad = ~np.isfinite(table)
    if bad.any():
        step, column = (int(index) for index in np.argwhere(bad)[0])
        raise UserError(f"{what}: step {step}, column {column} is {table[step, column]}; leave it out")
    return table


def _require_labels(labels: Sequence[str | None]) -> None:
    for number, label in enumerate(labels):
        if label is not None and (not isinstance(label, str) or not label):
            raise UserError(
                f"label of trajectory {number} is {label!r}; name the strategy with text, or say None if it "
                "is not known"
            )
    if None in labels:
        return
    for label in dict.fromkeys(labels):
        if list(labels).count(label) == 1:
            warnings.warn(
                f"strategy {label!r} has one demonstration only: chance in it will be learned as style",
                stacklevel=3,
            )
    if len(set(labels)) == 1:
        warnings.warn(
            f"all demonstrations are of strategy {labels[0]!r}: nothing can tell task and strategy apart",
            stacklevel=3,
        )


def _require_lengths(seen: list[NDArray[np.float64]], done: list[NDArray[np.float64]]) -> None:
    for number, (states, moves) in enumerate(zip(seen, done, strict=True)):
        if len(states) == len(moves) + 1:
            continue
        problem = f"trajectory {number}: {len(states)} observations and {len(moves)} actions"
        if len(states) != len(moves):
            raise UserError(f"{problem}; T+1 observations for T actions are needed")
        equal = [pair for pair in zip(seen, done, strict=True) if len(pair[0]) == len(pair[1])]
        likely = {0: "; the actions fit the first", 1: "; the actions fit the second"}
        raise UserError(
            f"{problem}; T+1 observations for T actions are needed: drop the last action if observations are "
            "what was seen before the action of the same row, the first action if they are what it led to"
            f"{likely.get(better_shift(equal), '')}"
        )


def _require_columns(kind: str, tables: list[NDArray[np.float64]], names: tuple[str, ...]) -> None:
    for number, table in enumerate(tables):
        if table.shape[1] != len(names):
            raise UserError(
                f"trajectory {number}: {table.shape[1]} {kind} columns instead of {len(names)} "
                f"({', '.join(names)})"
            )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"{kind} column {twice!r} is named twice; give every column a name of its own")


def _endings(terminated: bool | Sequence[bool] | None, done: list[NDArray[np.float64]]) -> NDArray[np.bool_]:
    if terminated is None:
        lengths = {len(moves) for moves in done}
        if len(lengths) > 1:
            raise UserError(
                f"trajectories of {min(lengths)} to {max(lengths)} steps: say with terminated= whether the "
                "episodes ended there (True) or were cut off (False), for all or for each"
            )
        terminated = False
    ended = np.asarray(terminated, dtype=bool)
    if ended.ndim and len(ended) != len(done):
        raise UserError(f"terminated: {len(ended)} values for {len(done)} trajectories; give one each")
    return np.broadcast_to(ended, len(done))


def _shift_text(shift: int) -> str:
    rows = f"{abs(shift)} row{'s' if abs(shift) > 1 else ''}"
    if shift > 0:
        return (
            f"actions explain the transitions best {rows} later than they stand (shift {shift:+d}): are the "
            "observations those after the action of the same row? Then drop the first action, not the last"
        )
    return (
        f"actions explain the transitions best {rows} earlier than they stand (shift {shift:+d}): "
        "action t has to be the one taken at observation t"
    )


def _stack(
    seen: list[NDArray[np.float64]],
    done: list[NDArray[np.float64]],
    labels: list[str],
    ended: NDArray[np.bool_],
    observation_names: tuple[str, ...],
    action_names: tuple[str, ...],
    control_period_s: float,
) -> Demonstrations:
    """Padded arrays; a trajectory that ended stays where it did until the horizon."""
    strategies = tuple(dict.fromkeys(labels))
    most = max(labels.count(label) for label in strategies)
    longest = max(len(moves) for moves in done)
    horizon = int(np.ceil(ROOM_AFTER_THE_LAST * longest)) if ended.any() else longest
    shape = (len(strategies), most)
    observations = np.zeros((*shape, horizon + 1, len(observation_names)))
    actions = np.zeros((*shape, horizon, len(action_names)))
    lengths, acting = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    filled = dict.fromkeys(strategies, 0)
    for label, states, moves, over in zip(labels, seen, done, ended, strict=True):
        place = strategies.index(label), filled[label]
        filled[label] += 1
        steps = acting[place] = len(moves)
        observations[place][: steps + 1], observations[place][steps + 1 :] = states, states[-1]
        actions[place][:steps] = moves
        lengths[place] = horizon if over else steps
    layout = Layout(observation_names, action_names, strategies, control_period_s)
    return Demonstrations(observations, actions, layout, lengths, acting)


def _numbered(kind: str, width: int) -> tuple[str, ...]:
    return tuple(f"{kind}_{index}" for index in range(width))
