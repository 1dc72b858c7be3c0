"""Groups whose demonstrations follow one policy but for small departures: every step is evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

Array = NDArray[np.float64]

NOISE_SHAPE, NOISE_SCALE = 1.0, 0.01
"""Of the inverse gamma distribution of a noise variance, in units of the outputs' own: it says little."""


class Regressions:
    """What features ``[T, F]`` and outputs ``[T, A]`` of N demonstrations say of linear weights.

    Attributes
    ----------
    eigenvalues, vectors
        ``[N, F]`` and ``[N, F, F]``, of the products of each demonstration's features.
    rotated
        ``[N, F, A]``, products of features and outputs in those vectors.
    squares
        ``[N, A]``, of the outputs.
    steps
        ``[N]``.
    """

    def __init__(self, features: Sequence[Array], outputs: Sequence[Array]) -> None:
        eigenvalues, self.vectors = np.linalg.eigh(np.stack([table.T @ table for table in features]))
        self.eigenvalues: Array = np.maximum(eigenvalues, 0.0)
        moments = np.stack([table.T @ output for table, output in zip(features, outputs, strict=True)])
        self.rotated: Array = np.swapaxes(self.vectors, 1, 2) @ moments
        self.squares: Array = np.stack([np.square(output).sum(axis=0) for output in outputs])
        self.steps: Array = np.array([len(output) for output in outputs], dtype=np.float64)


class SamePolicy:
    """Weights of a strategy, departures of its demonstrations and its noise, all integrated out.

    Output a of demonstration n of strategy k is ``features @ (B_k + U_n) + noise``, all three Gaussian: of
    variances ``(1 - share) ratio v``, ``share ratio v`` and ``v``, and ``v`` of each strategy and output is
    of an inverse gamma distribution: the normal-inverse-gamma model of Bayesian linear regression.

    Parameters
    ----------
    regressions
        What demonstrations say of their weights.
    ratio
        Variance of a weight in units of the noise's.
    share
        Of the weights' variance, that is the demonstrations' own.
    """

    def __init__(self, regressions: Regressions, ratio: float, share: float) -> None:
        own = 1.0 + share * ratio * regressions.eigenvalues
        vectors, rotated = regressions.vectors, regressions.rotated
        precision = (vectors * (regressions.eigenvalues / own)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        information = vectors @ (rotated / own[:, :, None])
        squares = regressions.squares - (share * ratio / own[:, :, None] * np.square(rotated)).sum(axis=1)
        count, self._features, self._outputs = information.shape
        self._prior = 1.0 / ((1.0 - share) * ratio)
        self.statistics: Array = np.concatenate(
            [
                precision.reshape(count, -1),
                information.reshape(count, -1),
                squares,
                regressions.steps[:, None],
                np.log(own).sum(axis=1, keepdims=True),
            ],
            axis=1,
        )

    def log_evidence(self, statistics: Array, counts: Array) -> Array:
        """Of groups."""
        features, outputs = self._features, self._outputs
        ends = np.cumsum([features**2, features * outputs, outputs, 1])
        precision, information, squares, steps, own = np.split(statistics, ends, axis=1)
        root = np.linalg.cholesky(precision.reshape(-1, features, features) + self._prior * np.eye(features))
        solved = np.linalg.solve(root, information.reshape(-1, features, outputs))
        left = np.maximum(squares - np.square(solved).sum(axis=1), 0.0)
        spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) - features * np.log(
            self._prior
        )
        shape = NOISE_SHAPE + 0.5 * steps
        each = (
            gammaln(shape)
            - gammaln(NOISE_SHAPE)
            + NOISE_SHAPE * np.log(NOISE_SCALE)
            - shape * np.log(NOISE_SCALE + 0.5 * left)
            - 0.5 * steps * np.log(2.0 * np.pi)
            - 0.5 * own
            - 0.5 * spread[:, None]
        )
        return np.asarray(each.sum(axis=1))
