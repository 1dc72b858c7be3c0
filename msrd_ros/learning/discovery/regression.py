"""Bayesian linear regressions of many demonstrations on the same features, one for each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]

_NOISES = np.logspace(-6, 0, 25)
_SIGNALS = np.logspace(-2, 6, 33)
_LAGS = 100
_LEAST_CORRELATION = 0.05
_SHARED_RIDGE = 1e-3


@dataclass(frozen=True)
class Regressions:
    """What features ``[T, F]`` and outputs ``[T, A]`` of N demonstrations say of the weights.

    Attributes
    ----------
    gram, eigenvalues, vectors
        ``[N, F, F]``, ``[N, F]``, ``[N, F, F]``: products of the features and their eigensystems.
    moments
        ``[N, F, A]``: products of features and outputs.
    rotated
        `moments` in the eigenvectors.
    squares
        ``[N, A]`` of the outputs.
    steps
        ``[N]``.
    correlation
        ``[A]``: how many steps of an output say as much as one independent one.
    noise, signal
        ``[A]``: variance of an output about its policy, and of a weight from one demonstration to another.
    """

    gram: Array
    eigenvalues: Array
    vectors: Array
    moments: Array
    rotated: Array
    squares: Array
    steps: Array
    correlation: Array
    noise: Array
    signal: Array

    @property
    def outputs(self) -> int:
        """A."""
        return int(self.moments.shape[2])

    @property
    def features(self) -> int:
        """F."""
        return int(self.moments.shape[1])

    def log_evidence(
        self, share: Array | float, noise: Array | None = None, signal: Array | None = None
    ) -> Array:
        """Of each demonstration's outputs, weights of variance ``share * signal`` integrated out, ``[N, A]``.

        Outputs count as ``1 / correlation`` of their steps.
        """
        noise = (self.noise if noise is None else noise) * self.correlation
        signal = (self.signal if signal is None else signal) * share
        ratio = self.eigenvalues[:, :, None] * signal / noise
        explained = (np.square(self.rotated) * signal / noise**2 / (1.0 + ratio)).sum(axis=1)
        count = self.steps[:, None] / self.correlation
        scale = np.log(2.0 * np.pi * noise / self.correlation)
        return np.asarray(
            -0.5 * (count * scale + np.log1p(ratio).sum(axis=1) + self.squares / noise - explained)
        )

    def messages(self, share: float) -> tuple[Array, Array]:
        """What each demonstration says of its strategy's weights, its own departures integrated out.

        Parameters
        ----------
        share
            Of a weight's variance that is the demonstration's own.

        Returns
        -------
        precision, information
            ``[N, A, F, F]`` and ``[N, A, F]``: of a Gaussian, in natural parameters.
        """
        noise = self.noise * self.correlation
        weight = 1.0 / (noise + share * self.signal * self.eigenvalues[:, :, None])
        scaled = (
            self.vectors[:, None] * np.swapaxes(self.eigenvalues[:, :, None] * weight, 1, 2)[:, :, None, :]
        )
        precision = scaled @ np.swapaxes(self.vectors, 1, 2)[:, None]
        information = np.einsum("nij,nja->nai", self.vectors, weight * self.rotated)
        return precision, information


def fit(features: Sequence[Array], outputs: Sequence[Array]) -> Regressions:
    """Regressions of what outputs have beyond the weights that all demonstrations share.

    Outputs are turned so that noise is independent between them. Noise and signal are those of the highest
    evidence; the correlation time of the residuals then says what a step is worth, and they are fitted anew.
    """
    own = _beyond_shared(features, outputs)
    first = _with_variances(_sums(features, own, np.ones(own[0].shape[1])))
    turned = _independent(features, own, first)
    second = _with_variances(_sums(features, turned, np.ones(turned[0].shape[1])))
    correlation = _correlation_steps(_residuals(features, turned, second))
    return _with_variances(_sums(features, turned, correlation))


def fit_as_they_are(features: Sequence[Array], outputs: Sequence[Array]) -> Regressions:
    """The same, outputs not turned and all steps counted in full."""
    own = _beyond_shared(features, outputs)
    return _with_variances(_sums(features, own, np.ones(own[0].shape[1])))


def _beyond_shared(features: Sequence[Array], outputs: Sequence[Array]) -> list[Array]:
    gram = sum((table.T @ table for table in features), np.zeros((features[0].shape[1],) * 2))
    gram = gram + _SHARED_RIDGE * len(features) * np.eye(len(gram))
    moments = sum(
        (table.T @ output for table, output in zip(features, outputs, strict=True)),
        np.zeros((len(gram), outputs[0].shape[1])),
    )
    weights = np.linalg.solve(gram, moments)
    return [output - table @ weights for table, output in zip(features, outputs, strict=True)]


def _sums(features: Sequence[Array], outputs: Sequence[Array], correlation: Array) -> Regressions:
    gram = np.stack([table.T @ table for table in features])
    moments = np.stack([table.T @ output for table, output in zip(features, outputs, strict=True)])
    eigenvalues, vectors = np.linalg.eigh(gram)
    return Regressions(
        gram,
        np.maximum(eigenvalues, 0.0),
        vectors,
        moments,
        np.swapaxes(vectors, 1, 2) @ moments,
        np.stack([np.square(output).sum(axis=0) for output in outputs]),
        np.array([len(output) for output in outputs], dtype=np.float64),
        correlation,
        np.ones(len(correlation)),
        np.ones(len(correlation)),
    )


def _with_variances(sums: Regressions) -> Regressions:
    """Noise and signal of the highest evidence, on a grid."""
    variance = np.maximum(sums.squares.sum(axis=0) / sums.steps.sum(), 1e-12)
    noise, signal, best = variance.copy(), variance.copy(), np.full(sums.outputs, -np.inf)
    for part in _NOISES:
        for ratio in _SIGNALS:
            evidence = sums.log_evidence(1.0, part * variance, ratio * part * variance).sum(axis=0)
            better = evidence > best
            best = np.where(better, evidence, best)
            noise = np.where(better, part * variance, noise)
            signal = np.where(better, ratio * part * variance, signal)
    values = {name: getattr(sums, name) for name in sums.__dataclass_fields__}
    return Regressions(**{**values, "noise": noise, "signal": signal})


def _residuals(features: Sequence[Array], outputs: Sequence[Array], fitted: Regressions) -> list[Array]:
    ridge = fitted.noise / fitted.signal
    left = []
    for index, (table, output) in enumerate(zip(features, outputs, strict=True)):
        shrunk = fitted.rotated[index] / (fitted.eigenvalues[index][:, None] + ridge)
        left.append(output - table @ (fitted.vectors[index] @ shrunk))
    return left


def _independent(features: Sequence[Array], outputs: Sequence[Array], fitted: Regressions) -> list[Array]:
    """Outputs turned so that their noise has unit covariance and what is explained is uncorrelated."""
    left, everything = np.concatenate(_residuals(features, outputs, fitted)), np.concatenate(outputs)
    noise, total = left.T @ left / len(left), everything.T @ everything / len(left)
    floor = 1e-9 * (np.trace(total) / len(total) + 1e-12) * np.eye(len(total))
    _, directions = eigh(total + floor, noise + floor)
    return [output @ directions for output in outputs]


def _correlation_steps(residuals: Sequence[Array]) -> Array:
    """Integrated autocorrelation time of each output's residuals, in steps, at least 1."""
    variance = sum(np.square(table).sum(axis=0) for table in residuals) + 1e-300
    steps = np.ones(residuals[0].shape[1])
    going = np.ones(len(steps), dtype=bool)
    for lag in range(1, _LAGS):
        products = sum((table[lag:] * table[:-lag]).sum(axis=0) for table in residuals if len(table) > lag)
        going &= products / variance > _LEAST_CORRELATION
        if not going.any():
            break
        steps += np.where(going, 2.0 * products / variance, 0.0)
    return steps
