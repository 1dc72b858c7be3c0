"""The two ends of the table: each arm sees the world in a frame of its own, and here is how they go over.

Every arm stands as its description says, at the near end of its own frame. The far arm's frame is the near
one, which is `world`, turned by pi about the vertical through the table's centre.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class End(StrEnum):
    """Where an arm stands; also the namespace of its topics."""

    NEAR = "near"
    FAR = "far"

    @property
    def other(self) -> End:
        """The opposite end."""
        return End.FAR if self is End.NEAR else End.NEAR

    @property
    def yaw_rad(self) -> float:
        """By how much its frame is turned in `world`, about z."""
        return 0.0 if self is End.NEAR else math.pi


def turned(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors of one end's frame in the other's; its own inverse.

    Parameters
    ----------
    vectors
        Positions, velocities or spins one after the other, shape (..., 3 M): a ball, a paddle, a sample.
    """
    result: NDArray[np.float64] = vectors.reshape(*vectors.shape[:-1], -1, 3) * np.array([-1.0, -1.0, 1.0])
    return result.reshape(vectors.shape)


def between(end: End, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3 M) of `world` in the frame of an end, or the other way round."""
    return vectors if end is End.NEAR else turned(vectors)
