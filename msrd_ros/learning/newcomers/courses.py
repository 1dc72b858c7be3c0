"""The courses of known strategies, and how well they and others explain the course of a demonstration.

A course is the mean state in each of a few phases of a trajectory. Demonstrations of one strategy differ
from it by deviates that are made unit normal (whitened). What tells K strategies apart lies in the K - 1
directions between their centres; what lies off them tells a stranger from all. How far demonstrations stray
along and off these directions is measured with those of the same person left out, or a person would be
measured by themselves; and with whole strategies left out, or nothing would be known of strangers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_t

from msrd_ros.core.errors import UserError
from msrd_ros.learning.newcomers.frame import PHASES, Frame, KnownCourses, Usual

Array = NDArray[np.float64]

_TAILS = 4.0
"""Degrees of freedom of Student's t: some strategies vary more than others, and there are few people."""


@dataclass(frozen=True)
class Courses:
    """Courses of K known strategies.

    Attributes
    ----------
    names
        Of the strategies.
    centres, counts
        ``[K, F]`` mean course of each, whitened, and of how many demonstrations it is, ``[K]``.
    frame, usual
        How courses are compared, and what is usual.
    """

    names: tuple[str, ...]
    centres: Array
    counts: NDArray[np.int64]
    frame: Frame
    usual: Usual

    @classmethod
    def fit(
        cls,
        observations: Sequence[NDArray[np.floating]],
        labels: Sequence[str],
        people: Sequence[str] = (),
    ) -> Courses:
        """What known demonstrations say.

        Parameters
        ----------
        observations
            ``[T+1, O]`` each, of any lengths.
        labels
            Whose each is.
        people
            Who showed each: what a stranger will be like follows from how people differ. Empty: each was
            shown by somebody else.

        Raises
        ------
        UserError
            If there are fewer than two strategies, or too few demonstrations to know what is usual.
        """
        names = tuple(dict.fromkeys(labels))
        if len(names) < 2:
            raise UserError("newcomers: one strategy is known; it takes two to know how strategies differ")
        for number, seen in enumerate(observations):
            if len(seen) <= PHASES:
                raise UserError(f"newcomers: demonstration {number} has {len(seen)} states; leave it out")
        data = KnownCourses.of(observations, labels, names)
        who = np.arange(len(labels)) if not people else np.unique(people, return_inverse=True)[1]
        frame, centres, counts = data.fitted(np.ones(len(labels), dtype=bool))
        left_out = [who == person for person in np.unique(who)]
        measured = [left for left in left_out if set(data.members[~left]) == set(data.members)]
        if sum(int(left.sum()) for left in measured) < 2 * len(names):
            raise UserError(
                "newcomers: too few demonstrations to know how far those of one strategy lie apart; give two "
                "or more of each strategy, or of more people"
            )
        return cls(names, centres, counts, frame, data.usual(frame, centres, measured))

    def whitened(self, course: Array) -> Array:
        """``[..., F]`` in deviations that are usual within a strategy."""
        return np.asarray(course @ self.frame.whitening)

    def log_evidence(self, course: Array, centres: Array, counts: NDArray[np.int64] | int) -> Array:
        """Of a course ``[F]`` if it was made by what has the whitened centres ``[n, F]``, ``[n]``.

        Parameters
        ----------
        counts
            Of how many courses each centre is the mean: one of few is uncertain itself.
        """
        here, frame, usual = self.whitened(course), self.frame, self.usual
        wider = np.broadcast_to(1.0 + 1.0 / np.asarray(counts, dtype=np.float64), centres.shape[:1])
        apart = (frame.along(here) - frame.along(centres)) / np.sqrt(wider)[:, None]
        width = apart.shape[1]
        along = multivariate_t.logpdf(apart, np.zeros(width), _scale(usual.spread), df=_TAILS)
        return np.asarray(
            along - 0.5 * width * np.log(wider) + _log_off(frame.off(here, centres) / wider, usual.own)
        )

    def known_evidence(self, course: Array) -> Array:
        """`log_evidence` of each known strategy, ``[K]``."""
        return self.log_evidence(course, self.centres, self.counts)

    def strange_evidence(self, course: Array) -> float:
        """Log evidence of a course ``[F]`` if it was made by a strategy that nobody knows."""
        here, frame, usual = self.whitened(course), self.frame, self.usual
        along = frame.along(here)
        # A stranger's centre is drawn as the known ones were, and strays about it.
        wide = _scale(usual.spread + usual.between)
        density = multivariate_t.logpdf(along, np.zeros(len(along)), wide, df=_TAILS)
        off = float(np.log(np.maximum(frame.off(here, frame.middle), 1e-12)))
        mean, deviation = usual.strange
        # Further off than strangers usually are is no less strange.
        return float(density) + _log_normal(min(off, mean), mean, deviation)

    def usual_evidence(self) -> float:
        """Log evidence of a demonstration that lies as near to its strategy as half of them do, about."""
        width = self.frame.basis.shape[1]
        middle = np.sqrt(np.diag(_scale(self.usual.spread)))
        along = multivariate_t.logpdf(middle, np.zeros(width), _scale(self.usual.spread), df=_TAILS)
        return float(along) + float(_log_off(np.exp(self.usual.own[0]), self.usual.own))

    def with_strategy(self, name: str, course: Array, count: int) -> Courses:
        """One strategy more, of so many demonstrations with this mean course."""
        return replace(
            self,
            names=(*self.names, name),
            centres=np.concatenate([self.centres, self.whitened(course)[None]]),
            counts=np.append(self.counts, count),
        )

    def without(self, name: str) -> Courses:
        """One strategy less."""
        kept = np.array([known != name for known in self.names])
        names = tuple(known for known in self.names if known != name)
        return replace(self, names=names, centres=self.centres[kept], counts=self.counts[kept])

    def with_member(self, name: str, course: Array, count: int) -> Courses:
        """More demonstrations of a known strategy."""
        row = self.names.index(name)
        share = count / (self.counts[row] + count)
        centres, counts = self.centres.copy(), self.counts.copy()
        centres[row] += share * (self.whitened(course) - centres[row])
        counts[row] += count
        return replace(self, centres=centres, counts=counts)


def _scale(covariance: Array) -> Array:
    """Of Student's t with that covariance."""
    return np.asarray(covariance * (_TAILS - 2.0) / _TAILS)


def _log_normal(value: Array | float, mean: float, deviation: float) -> float:
    return float(-0.5 * np.square((value - mean) / deviation) - np.log(deviation))


def _log_off(squares: Array, usual: tuple[float, float]) -> Array:
    """Log density of logarithms of squared distances; nearer than usual is as good as usual."""
    mean, deviation = usual
    beyond = np.maximum(np.log(np.maximum(squares, 1e-12)) - mean, 0.0)
    return np.asarray(-0.5 * np.square(beyond / deviation) - np.log(deviation))
