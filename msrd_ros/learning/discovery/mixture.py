"""Groups whose demonstrations differ, as those of several teachers do: a demonstration is one observation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import multigammaln

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """How demonstrations scatter about their strategy's mean, and the means about a centre.

    Attributes
    ----------
    scale
        ``[q, q]`` of the inverse Wishart distribution of a group's covariance.
    freedom
        Its degrees of freedom: the fewer, the more groups may differ in scatter.
    ratio
        Variance of the means in units of the groups' own.
    """

    scale: Array
    freedom: float
    ratio: float

    def log_weight_of_centre(self, sizes: NDArray[np.integer]) -> float:
        """What the evidence of groups about zero lacks of that about a centre of which nothing is known.

        The centre's precision is the sum of the groups' of their means; so many groups lose by it, since
        demonstrations have been centred, which one group alone would pay for as if it were news.
        """
        return -0.5 * len(self.scale) * float(np.log((sizes / (1.0 + sizes * self.ratio)).sum()))


class Mixture:
    """Gaussian groups, mean and covariance of each integrated out.

    ``x_n ~ N(m_k, C_k)``, ``m_k ~ N(0, ratio C_k)``, ``C_k ~ inverse Wishart(scale, freedom)``: the closed
    form in Murphy (2007), "Conjugate Bayesian analysis of the Gaussian distribution", eq. 266.

    Parameters
    ----------
    values
        ``[N, q]``.
    spread
        What all groups have in common.
    """

    def __init__(self, values: Array, spread: Spread) -> None:
        count, width = values.shape
        products = values[:, :, None] * values[:, None, :]
        self.statistics = np.concatenate([values, products.reshape(count, -1)], axis=1)
        self._spread, self._width = spread, width
        self._log_scale = np.linalg.slogdet(spread.scale)[1]
        sizes = np.arange(count + 1, dtype=np.float64)
        gammas = np.array([multigammaln(0.5 * (spread.freedom + size), width) for size in sizes])
        self._of_size = (
            gammas
            - gammas[0]
            - 0.5 * sizes * width * np.log(np.pi)
            - 0.5 * width * np.log1p(sizes * spread.ratio)
            + 0.5 * spread.freedom * self._log_scale
        )

    def log_evidence(self, statistics: Array, counts: Array) -> Array:
        """Of groups."""
        scatter = self.scatter(statistics, counts)
        log_size = np.linalg.slogdet(self._spread.scale + scatter)[1]
        return np.asarray(
            self._of_size[counts.astype(np.int64)] - 0.5 * (self._spread.freedom + counts) * log_size
        )

    def scatter(self, statistics: Array, counts: Array) -> Array:
        """About the mean, shrunk to zero, ``[C, q, q]``."""
        sums = statistics[:, : self._width]
        products = statistics[:, self._width :].reshape(-1, self._width, self._width)
        shrink = self._spread.ratio / (1.0 + counts * self._spread.ratio)
        return np.asarray(products - shrink[:, None, None] * sums[:, :, None] * sums[:, None, :])
