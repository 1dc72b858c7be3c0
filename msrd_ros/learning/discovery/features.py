"""What a policy is a linear function of: smooth features of the state, and of the time since the start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LANDMARKS = 600
FEATURES = 96
COSINES = 10
_LEAST_EIGENVALUE = 1e-8


def standardised(tables: Sequence[Array]) -> list[Array]:
    """Columns of mean 0 and deviation 1 over all tables ``[T, C]``; one that never moves becomes 0."""
    everything = np.concatenate(tables)
    mean, deviation = everything.mean(axis=0), everything.std(axis=0)
    moves = deviation > 1e-9 * np.maximum(1.0, np.abs(everything).max(axis=0))
    scale = np.where(moves, 1.0 / np.where(moves, deviation, 1.0), 0.0)
    return [(table - mean) * scale for table in tables]


def state_features(states: Sequence[Array], length_scale: float, rng: np.random.Generator) -> list[Array]:
    """Features ``[T, F]`` whose products approximate a squared-exponential kernel of states ``[T, O]``.

    The leading eigenfunctions of the kernel at landmarks drawn from the states (Nystroem's method; Williams
    and Seeger, 2001), so that weights with a standard normal prior are a draw of the Gaussian process.

    Parameters
    ----------
    length_scale
        In units of the root of the number of columns: how far apart standardised states usually are.
    """
    everything = np.concatenate(states)
    chosen = rng.choice(len(everything), min(LANDMARKS, len(everything)), replace=False)
    landmarks = everything[chosen]
    eigenvalues, vectors = np.linalg.eigh(_kernel(landmarks, landmarks, length_scale))
    leading = np.argsort(eigenvalues)[::-1][:FEATURES]
    leading = leading[eigenvalues[leading] > _LEAST_EIGENVALUE * eigenvalues[leading[0]]]
    projection = vectors[:, leading] / np.sqrt(eigenvalues[leading])
    return [
        np.concatenate([_kernel(table, landmarks, length_scale) @ projection, _linear(table)], axis=1)
        for table in states
    ]


def _linear(states: Array) -> Array:
    """Constant and columns: far from all landmarks the kernel knows nothing."""
    count = states.shape[1]
    return np.concatenate([np.ones((len(states), 1)), states / np.sqrt(count)], axis=1)


def courses(actions: Sequence[Array], count: int) -> Array:
    """What the courses of actions ``[T, A]`` differ in most between demonstrations, ``[N, count]``.

    Principal components of slow cosines of the time since the start, the longest demonstration taking half a
    period; a cosine counts the less the faster it is, as in the motion that comes of the actions. Actions
    keep the scale that they have to each other: which of them do much tells more than which do little.
    """
    longest = max(map(len, actions))
    orders = np.arange(COSINES)
    scale = float(np.concatenate(actions).std()) or 1.0
    rows = []
    for table in actions:
        basis = np.sqrt(2.0) * np.cos((np.arange(len(table))[:, None] + 0.5) / longest * np.pi * orders)
        basis[:, 0] = 1.0
        weights, *_ = np.linalg.lstsq(basis, table / scale, rcond=None)
        rows.append((weights / (1.0 + orders)[:, None]).ravel())
    centred = np.stack(rows) - np.mean(rows, axis=0)
    left, sizes, _ = np.linalg.svd(centred, full_matrices=False)
    return np.asarray(left[:, :count] * sizes[:count])


def _kernel(left: Array, right: Array, length_scale: float) -> Array:
    squares = np.square(left).sum(axis=1)[:, None] + np.square(right).sum(axis=1) - 2.0 * left @ right.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / (length_scale**2 * left.shape[1])))
