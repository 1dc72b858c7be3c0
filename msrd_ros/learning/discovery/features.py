"""What a policy is a linear function of: smooth features of the state, and of the time since the start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LANDMARKS = 300
FEATURES = 96
PATH_FEATURES = 10
_LEAST_EIGENVALUE = 1e-8
_LEAST_VARIANCE = 1e-3


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


def path_features(states: Sequence[Array]) -> list[Array]:
    """Slow cosines of the time since the start ``[T, F]``, the longest trajectory taking half a period."""
    longest = max(map(len, states))
    orders = np.pi * np.arange(PATH_FEATURES)
    return [np.cos(np.arange(len(table))[:, None] / longest * orders) for table in states]


def decorrelated(tables: Sequence[Array]) -> list[Array]:
    """Principal components of variance 1, without those that hardly move: columns may say a thing twice."""
    everything = np.concatenate(tables)
    eigenvalues, vectors = np.linalg.eigh(np.atleast_2d(np.cov(everything.T)))
    kept = eigenvalues > _LEAST_VARIANCE * eigenvalues.max()
    projection = vectors[:, kept] / np.sqrt(eigenvalues[kept])
    return [table @ projection for table in tables]


def _kernel(left: Array, right: Array, length_scale: float) -> Array:
    squares = np.square(left).sum(axis=1)[:, None] + np.square(right).sum(axis=1) - 2.0 * left @ right.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / (length_scale**2 * left.shape[1])))
