"""The study's tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2


class FriedmanTest(NamedTuple):
    """Friedman's statistic, its degrees of freedom, and the probability of a larger one by chance."""

    statistic: float
    freedom: int
    p: float


def friedman(table: NDArray[np.floating]) -> FriedmanTest:
    """Friedman's test over the rows of a table.

    ``chi2 = 12 / (n k (k + 1)) * sum_j R_j^2 - 3 n (k + 1)`` with R_j the sum of ranks of column j; values
    that tie share the mean of their ranks, without further correction.

    Parameters
    ----------
    table
        n rows (what is paired) of k conditions each, shape (n, k).
    """
    values = np.asarray(table, dtype=np.float64)
    rows, conditions = values.shape
    lower = (values[:, None, :] < values[:, :, None]).sum(axis=2)
    equal = (values[:, None, :] == values[:, :, None]).sum(axis=2)
    sums = (lower + (equal + 1) / 2.0).sum(axis=0)
    statistic = 12.0 / (rows * conditions * (conditions + 1)) * float(sums @ sums)
    statistic -= 3.0 * rows * (conditions + 1)
    return FriedmanTest(statistic, conditions - 1, float(chi2.sf(statistic, conditions - 1)))


def diagonal_wins(matrix: NDArray[np.floating]) -> int:
    """Rows of a square matrix whose largest value stands on the diagonal."""
    return int((np.asarray(matrix).argmax(axis=1) == np.arange(len(matrix))).sum())
