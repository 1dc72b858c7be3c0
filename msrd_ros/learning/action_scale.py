"""Actions in units of their range, so that one recipe explores alike in every environment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ActionScale:
    """``action = centre + half * unit``, column by column.

    Attributes
    ----------
    centre, half
        ``[A]`` in the environment's own units.
    """

    centre: NDArray[np.float64]
    half: NDArray[np.float64]

    @classmethod
    def of(
        cls, low: NDArray[np.float64], high: NDArray[np.float64], actions: NDArray[np.floating]
    ) -> ActionScale:
        """By the bounds ``[A]``; where there are none, by the largest of demonstrated ``actions [N, A]``."""
        bounded = np.isfinite(low) & np.isfinite(high)
        largest = np.maximum(np.abs(actions).max(axis=0), 1e-6)
        with np.errstate(invalid="ignore"):
            centre = np.where(bounded, (low + high) / 2.0, 0.0)
            half = np.where(bounded, (high - low) / 2.0, largest)
        return cls(centre, half)

    def to_unit(self, actions: NDArray[np.floating]) -> NDArray[np.float64]:
        """Of ``actions [..., A]``."""
        return np.asarray((actions - self.centre) / self.half)

    def from_unit(self, units: NDArray[np.floating]) -> NDArray[np.float64]:
        """Of ``units [..., A]``."""
        return np.asarray(self.centre + self.half * units)
