"""Kullback-Leibler divergence of two samples by nearest neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def nearest_neighbour_divergence(
    first: NDArray[np.floating], second: NDArray[np.floating], resolution: float
) -> float:
    """Estimate of KL(p || q) from samples of both, in nats (Wang, Kulkarni and Verdu 2009, k = 1).

    Parameters
    ----------
    first, second
        ``[N, D]`` from p, ``[M, D]`` from q.
    resolution
        Distances count as this at least. Equal samples, as of a lander at rest, have no density; each of them
        then adds D times a logarithm of this number, whatever it is.
    """
    count, width = first.shape
    own = cKDTree(first).query(first, k=2)[0][:, 1]
    other = cKDTree(second).query(first, k=1)[0]
    ratio = np.log(np.maximum(other, resolution)) - np.log(np.maximum(own, resolution))
    return float(width * ratio.mean() + np.log(len(second) / (count - 1)))
