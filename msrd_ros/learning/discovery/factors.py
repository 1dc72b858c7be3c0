"""A few numbers that say in what the policies and ways of demonstrations differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.discovery.regression import Regressions

Array = NDArray[np.float64]

OWN_SHARE = 0.5
"""Of a weight's variance, that factors need not explain: so no well-known weight outweighs all others."""
_ROUNDS = 15


def factors(ways: Regressions, count: int) -> Array:
    """Factors ``[N, count]`` of variance 1 of the demonstrations' weights.

    Factor analysis in which each demonstration's weights are known only as far as its steps tell: the total
    variability model of speaker recognition (Dehak et al., 2011), by expectation maximisation.
    """
    precisions, informations = ways.messages(OWN_SHARE)
    variance = (1.0 - OWN_SHARE) * ways.signal
    demonstrations = len(precisions)
    factor = _principal(ways, precisions, informations, count)
    spread = np.tile(0.01 * np.eye(count), (demonstrations, 1, 1))
    for _ in range(_ROUNDS):
        moment = factor[:, :, None] * factor[:, None, :] + spread
        precision = np.tile(np.eye(count), (demonstrations, 1, 1))
        information = np.zeros((demonstrations, count))
        for output in range(ways.outputs):
            said, told = precisions[:, output], informations[:, output]
            loading = _loading(said, told, factor, moment, variance[output])
            precision += loading.T @ said @ loading
            information += told @ loading
        spread = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        factor = (spread @ information[..., None])[..., 0]
        moment = factor[:, :, None] * factor[:, None, :] + spread
        whitening = np.linalg.inv(np.linalg.cholesky(moment.mean(axis=0)))
        factor = np.asarray(factor @ whitening.T)
        spread = np.asarray(whitening @ spread @ whitening.T)
    return np.asarray((factor - factor.mean(axis=0)) / np.maximum(factor.std(axis=0), 1e-12))


def _principal(ways: Regressions, precisions: Array, informations: Array, count: int) -> Array:
    """Where to start: principal components of each demonstration's own weights."""
    prior = 1.0 / ((1.0 - OWN_SHARE) * ways.signal)
    matrices = precisions + prior[:, None, None] * np.eye(ways.features)
    weights = np.linalg.solve(matrices, informations[..., None])[..., 0] / np.sqrt(ways.signal)[:, None]
    table = weights.reshape(len(weights), -1)
    left, _, _ = np.linalg.svd(table - table.mean(axis=0), full_matrices=False)
    return np.asarray(left[:, :count] * np.sqrt(len(left)))


def _loading(precision: Array, information: Array, factor: Array, moment: Array, variance: float) -> Array:
    """Weights of variance 1 a factor ``[F, count]``, given the factors."""
    features, count = information.shape[1], factor.shape[1]
    flat = precision.reshape(len(precision), -1).T @ moment.reshape(len(moment), -1)
    system = flat.reshape(features, features, count, count).transpose(0, 2, 1, 3)
    size = features * count
    matrix = system.reshape(size, size) + count / variance * np.eye(size)
    return np.asarray(np.linalg.solve(matrix, (information.T @ factor).ravel()).reshape(features, count))
