"""Whether actions stand beside the observations that they were taken at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Trajectory = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Observations ``[n, O]`` and actions ``[m, A]``, n and m about equal."""

SHIFTS = (0, 1, -1, 2, -2)
LEAST_SAMPLES, MOST_SAMPLES = 80, 20_000
MOST_PRODUCTS = 300
"""Of action and state columns; with more, actions count as if they did the same in every state."""
CLEAR = 1.5
"""How much more another shift has to explain before it is believed."""
LEAST_EXPLAINED = 0.02
_RIDGE = 1e-3


def explained_by_actions(trajectories: Sequence[Trajectory], shift: int) -> float:
    """Share of the transitions' variance that actions `shift` rows later explain, beyond what states do.

    Actions answer states and states answer actions, so bare correlation fits a reaction as well as a cause.
    What a state does not predict of the action taken in it (hand, noise, what is not linear) can only act on
    what comes after: that is held against what the state does not predict of the transition. Half of the
    trajectories' samples are fitted, the other half judged; 0 at least.
    """
    parts = [_aligned(*trajectory, shift) for trajectory in trajectories]
    before, after, action = (np.concatenate([part[index] for part in parts]) for index in range(3))
    acted_at = np.concatenate([part[3] for part in parts])
    if len(before) < LEAST_SAMPLES:
        return 0.0
    stride = -(-len(before) // MOST_SAMPLES)
    before, after, action, acted_at = (array[::stride] for array in (before, after, action, acted_at))
    change = _standard(after - before)
    change = change - _fit(_curved(_standard(before)), change, slice(None))
    surprise = _standard(action)
    surprise = surprise - _fit(_curved(_standard(acted_at)), surprise, slice(None))
    inputs = np.concatenate([surprise, np.abs(surprise)], axis=1)
    if before.shape[1] * action.shape[1] <= MOST_PRODUCTS:
        mixed = surprise[:, :, None] * _standard(before)[:, None, :]
        inputs = np.concatenate([inputs, mixed.reshape(len(inputs), -1)], axis=1)
    left = change - _fit(inputs, change, slice(0, None, 2))
    total, rest = np.square(change[1::2]).sum(axis=0), np.square(left[1::2]).sum(axis=0)
    shares = 1.0 - rest / np.maximum(total, 1e-12 * len(change))
    return max(0.0, float(np.mean(shares.clip(0.0, 1.0))))


def better_shift(trajectories: Sequence[Trajectory]) -> int:
    """Rows by which actions stand too early (positive) or too late; 0 if nothing explains clearly more."""
    scores = {shift: explained_by_actions(trajectories, shift) for shift in SHIFTS}
    best = max(scores, key=scores.__getitem__)
    if scores[best] < LEAST_EXPLAINED or scores[best] < CLEAR * scores[0]:
        return 0
    return best


def _aligned(
    observations: NDArray[np.float64], actions: NDArray[np.float64], shift: int
) -> tuple[NDArray[np.float64], ...]:
    """States, their successors, the actions `shift` rows later, and the states beside those in the data."""
    rows = np.arange(len(observations) - 1)
    rows = rows[(rows + shift >= 0) & (rows + shift < min(len(actions), len(observations)))]
    return observations[rows], observations[rows + 1], actions[rows + shift], observations[rows + shift]


def _standard(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean 0 and deviation 1; columns that do not move become 0."""
    deviation = values.std(axis=0)
    moves = deviation > 1e-9 * max(1.0, float(np.abs(values).max(initial=0.0)))
    return np.asarray(
        (values - values.mean(axis=0)) * np.where(moves, 1.0 / np.maximum(deviation, 1e-300), 0.0)
    )


def _curved(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Random tanh features beside the values themselves."""
    rng = np.random.default_rng(0)
    count = min(300, max(4, len(values) // 20))
    weights = rng.normal(size=(values.shape[1], count)) / np.sqrt(values.shape[1])
    return np.concatenate([values, np.tanh(2.0 * values @ weights + rng.normal(size=count))], axis=1)


def _fit(inputs: NDArray[np.float64], targets: NDArray[np.float64], rows: slice) -> NDArray[np.float64]:
    """Ridge regression on some rows, evaluated on all."""
    inputs = np.concatenate([inputs, np.ones((len(inputs), 1))], axis=1)
    seen = inputs[rows]
    gram = seen.T @ seen + _RIDGE * len(seen) * np.eye(inputs.shape[1])
    return np.asarray(inputs @ np.linalg.solve(gram, seen.T @ targets[rows]))
