"""What a newcomer shows, held against what was learned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.newcomers.frame import PHASES

Array = NDArray[np.float64]

MOST_SHOWN = 12
"""Demonstrations of one newcomer that count, the latest."""


def checked(
    layout: Layout, observations: Sequence[ArrayLike], actions: Sequence[ArrayLike]
) -> tuple[Array, Array]:
    """Observations ``[M, T+1, O]`` and actions ``[M, T_act, A]`` of M demonstrations of one length.

    Raises
    ------
    UserError
        Naming the demonstration and what is wrong with it.
    """
    if len(observations) != len(actions) or not len(observations):
        raise UserError(
            f"newcomer: {len(observations)} arrays of observations and {len(actions)} of actions; give "
            "one of each for every demonstration, one at least"
        )
    seen = [np.asarray(array, dtype=np.float64) for array in observations]
    done = [np.asarray(array, dtype=np.float64) for array in actions]
    for number, (states, moves) in enumerate(zip(seen, done, strict=True)):
        wanted = len(layout.observation_names), len(layout.action_names)
        if states.ndim != 2 or moves.ndim != 2 or (states.shape[1], moves.shape[1]) != wanted:
            raise UserError(
                f"newcomer: demonstration {number} has observations {states.shape} and actions "
                f"{moves.shape}; "
                f"give [T+1, {wanted[0]}] and [T, {wanted[1]}]"
            )
        if len(states) <= max(len(moves), PHASES):
            raise UserError(
                f"newcomer: demonstration {number} has {len(states)} states and {len(moves)} actions; "
                f"give one state more than actions, and more than {PHASES}"
            )
        if not (np.isfinite(states).all() and np.isfinite(moves).all()):
            raise UserError(f"newcomer: demonstration {number} holds a number that is not finite")
        if states.shape != seen[0].shape or moves.shape != done[0].shape:
            raise UserError(
                f"newcomer: demonstration {number} has {len(states)} states, the first {len(seen[0])}; "
                "give them one by one"
            )
    return np.stack(seen), np.stack(done)


def together(name: str, earlier: tuple[Array, Array], latest: tuple[Array, Array]) -> tuple[Array, Array]:
    """Observations and actions that were shown under one name, the latest `MOST_SHOWN` of them.

    Raises
    ------
    UserError
        If they are of different lengths.
    """
    if any(first.shape[1:] != second.shape[1:] for first, second in zip(earlier, latest, strict=True)):
        raise UserError(
            f"newcomer {name}: has {latest[0].shape[1]} states, those before {earlier[0].shape[1]}; "
            "choose another name"
        )
    seen, done = (np.concatenate(pair)[-MOST_SHOWN:] for pair in zip(earlier, latest, strict=True))
    return seen, done
