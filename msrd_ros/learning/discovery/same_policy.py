"""Groups whose demonstrations follow one policy but for small departures: every step is evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.discovery.regression import Regressions

Array = NDArray[np.float64]


class SamePolicy:
    """Weights of a strategy and a demonstration's departure from them, both integrated out.

    The weights of demonstration n of strategy k are ``B_k + U_n``: ``B_k ~ N(0, (1 - share) signal I)`` and
    ``U_n ~ N(0, share signal I)``.

    Parameters
    ----------
    regressions
        What demonstrations say of their weights.
    share
        Of the variance, that is the demonstrations' own.
    """

    def __init__(self, regressions: Regressions, share: float) -> None:
        precision, information = regressions.messages(share)
        count = len(precision)
        self._shape = precision.shape[1:]
        self._width = int(np.prod(self._shape))
        self._prior = 1.0 / ((1.0 - share) * regressions.signal)
        self.statistics = np.concatenate(
            [precision.reshape(count, -1), information.reshape(count, -1)], axis=1
        )
        self.constant = float(regressions.log_evidence(share).sum())
        """What is the same for all partitions, but not for all shares."""

    def log_evidence(self, statistics: Array, counts: Array) -> Array:
        """Of groups, beyond that of demonstrations whose strategy has no weights."""
        precision = statistics[:, : self._width].reshape(-1, *self._shape)
        information = statistics[:, self._width :].reshape(-1, *self._shape[:2])
        features = self._shape[-1]
        precision = precision + self._prior[:, None, None] * np.eye(features)
        root = np.linalg.cholesky(precision)
        solved = np.linalg.solve(root, information[..., None])[..., 0]
        log_root = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
        each = 0.5 * np.square(solved).sum(axis=-1) - log_root + 0.5 * features * np.log(self._prior)
        return np.asarray(each.sum(axis=-1))
