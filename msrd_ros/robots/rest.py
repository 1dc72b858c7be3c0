"""Where an arm rests, told by several measurements: one alone may be anything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AGREE_RAD = 0.02
"""Postures of an arm at rest differ by less."""
AGREE_S = 0.1
"""For so long they have to."""
_ROUNDING_S = 1e-9
GAP_S = 0.2
"""Measurements further apart do not follow one another."""


class RestFinder:
    """Finds an arm at rest once all measured postures have agreed for a while."""

    def __init__(self) -> None:
        self._first: tuple[Array, float] | None = None
        self._last_s = 0.0

    def see(self, position: Array, now_s: float) -> bool:
        """Whether this posture (N,) in rad is where the arm rests.

        Parameters
        ----------
        position
            As measured now.
        now_s
            Clock in seconds that never goes back.
        """
        follows = now_s - self._last_s <= GAP_S
        self._last_s = now_s
        if self._first is None or not follows or np.abs(position - self._first[0]).max() > AGREE_RAD:
            self._first = position.copy(), now_s
        return now_s - self._first[1] >= AGREE_S - _ROUNDING_S

    def forget(self) -> None:
        """Begin anew: something that was measured cannot be."""
        self._first = None
