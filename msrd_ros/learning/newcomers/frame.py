"""In which coordinates courses are compared, and what is usual there, measured on known demonstrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PHASES = 8
"""Parts of equal length that a trajectory is averaged over."""
_LEAST_DEVIATION = 1e-2
"""Of a phase within a strategy, as a share of the column's deviation over all states."""
_LEAST_LOG_DEVIATION = 0.2


def course_of(observations: Sequence[NDArray[np.floating]]) -> Array:
    """Mean state in each phase, averaged over trajectories ``[T+1, O]``: ``[PHASES * O]``."""
    return np.asarray(np.mean([_course(seen) for seen in observations], axis=0), dtype=np.float64)


def _course(observations: NDArray[np.floating]) -> Array:
    phases = np.array_split(np.asarray(observations, dtype=np.float64)[1:], PHASES)
    return np.concatenate([phase.mean(axis=0) for phase in phases])


@dataclass(frozen=True)
class Frame:
    """Coordinates in which courses are compared.

    Attributes
    ----------
    whitening
        ``[F, F]``: makes deviations within a strategy unit normal.
    basis
        ``[F, R]``, orthonormal: directions between the strategies' centres, whitened.
    middle
        ``[F]``: mean of the centres, whitened.
    """

    whitening: Array
    basis: Array
    middle: Array

    def along(self, whitened: Array) -> Array:
        """Coordinates between strategies, ``[..., R]``."""
        return np.asarray((whitened - self.middle) @ self.basis)

    def off(self, whitened: Array, centre: Array) -> Array:
        """Squared distance a direction from a centre ``[..., F]`` apart from those coordinates, ``[...]``."""
        apart = whitened - centre
        along = apart @ self.basis
        rest = np.square(apart).sum(axis=-1) - np.square(along).sum(axis=-1)
        return np.asarray(rest / max(self.basis.shape[0] - self.basis.shape[1], 1))


@dataclass(frozen=True)
class Usual:
    """What is usual, with everything of a person or a strategy left out that is measured.

    Attributes
    ----------
    spread
        ``[R, R]``: covariance of demonstrations about their strategy between strategies.
    between
        ``[R, R]``: covariance of the strategies' centres there.
    own, strange
        Mean and deviation of the logarithm of `Frame.off`, from the own strategy, and of demonstrations
        of a strategy that nobody knows.
    """

    spread: Array
    between: Array
    own: tuple[float, float]
    strange: tuple[float, float]


@dataclass(frozen=True)
class KnownCourses:
    """Courses ``[n, F]``, the strategy of each, and the least deviation of every feature."""

    courses: Array
    members: NDArray[np.int64]
    floor: Array

    @classmethod
    def of(
        cls, observations: Sequence[NDArray[np.floating]], labels: Sequence[str], names: tuple[str, ...]
    ) -> KnownCourses:
        """From trajectories ``[T+1, O]`` and whose each is."""
        column = np.concatenate([np.asarray(seen, dtype=np.float64) for seen in observations]).std(axis=0)
        return cls(
            np.stack([_course(seen) for seen in observations]),
            np.array([names.index(label) for label in labels]),
            _LEAST_DEVIATION * np.tile(np.maximum(column, 1e-12), PHASES),
        )

    def fitted(self, used: NDArray[np.bool_]) -> tuple[Frame, Array, NDArray[np.int64]]:
        """Frame, whitened centres and counts by the courses that are `used`, of strategies that have any."""
        members = np.unique(self.members[used], return_inverse=True)[1].astype(np.int64)
        courses = self.courses[used]
        counts = np.bincount(members)
        centres = np.zeros((len(counts), courses.shape[1]))
        np.add.at(centres, members, courses / counts[members][:, None])
        several = counts[members] > 1
        # Deviations from a mean that they are part of are too small.
        enlarged = np.sqrt(counts / np.maximum(counts - 1, 1))[members, None]
        within = ((courses - centres[members]) * enlarged)[several]
        scale = np.maximum(np.sqrt(np.square(within).mean(axis=0)) if len(within) else 0.0, self.floor)
        values, vectors = np.linalg.eigh(shrunk_covariance(within / scale))
        whitening = (vectors / np.sqrt(values)) / scale[:, None]
        centres = centres @ whitening
        middle = centres.mean(axis=0)
        directions = np.linalg.svd((centres - middle).T, full_matrices=False)[0][:, : len(counts) - 1]
        return Frame(whitening, directions, middle), centres, counts

    def usual(self, frame: Frame, centres: Array, left_out: Sequence[NDArray[np.bool_]]) -> Usual:
        """See `Usual`; `left_out` are the demonstrations of each person."""
        strays, own, strange = [], [], []
        for left in left_out:
            there, others, counts = self.fitted(~left)
            members = self.members[left]
            wider = 1.0 + 1.0 / counts[members]
            here = self.courses[left] @ there.whitening
            # Told by how far the centres are apart: directions of a part differ in sign, order and length.
            turn = np.linalg.lstsq(there.along(others), frame.along(centres), rcond=None)[0]
            strays.append(there.along(here - others[members] + there.middle) @ turn / np.sqrt(wider)[:, None])
            own.append(there.off(here, others[members]) / wider)
        for strategy in np.unique(self.members):
            left = self.members == strategy
            if len(centres) > 2:
                there, _, _ = self.fitted(~left)
                strange.append(there.off(self.courses[left] @ there.whitening, there.middle))
        straying = np.concatenate(strays)
        between = np.atleast_2d(np.cov(frame.along(centres).T))
        spread = shrunk_covariance(straying)
        nearby = _moments(own)
        return Usual(spread, between, nearby, _moments(strange) if strange else (nearby[0] + 2.0, 1.0))


def _moments(squares: Sequence[Array]) -> tuple[float, float]:
    logarithms = np.log(np.maximum(np.concatenate(squares), 1e-12))
    return float(logarithms.mean()), max(float(logarithms.std()), _LEAST_LOG_DEVIATION)


def shrunk_covariance(rows: Array) -> Array:
    """Of rows ``[n, F]`` of mean 0, drawn towards a multiple of the identity (Ledoit and Wolf, 2004)."""
    count, width = rows.shape
    if not count:
        return np.eye(width)
    sample = rows.T @ rows / count
    target = np.trace(sample) / width * np.eye(width)
    apart = float(np.square(sample - target).sum())
    # The mean of |x x' - S|^2 is that of |x|^4, less |S|^2.
    noise = float((np.square(np.square(rows).sum(axis=1)).mean() - np.square(sample).sum()) / count)
    share = min(1.0, noise / apart) if apart > 0.0 else 1.0
    floor = 1e-6 * np.trace(sample) / width + 1e-12
    return np.asarray((1.0 - share) * sample + share * target + floor * np.eye(width))
