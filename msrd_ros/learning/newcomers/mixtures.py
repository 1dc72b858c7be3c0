"""Weights with which two known strategies together come closest to a demonstration, found by playing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.special import logsumexp

from msrd_ros.learning.newcomers.courses import Courses
from msrd_ros.learning.newcomers.frame import course_of

Array = NDArray[np.float64]

Player = Callable[[dict[str, float], int], list[NDArray[np.floating]]]
"""Plays the weighted mean of policies, by weight and name, for so many episodes: ``[T+1, O]`` each."""

MOST_EPISODES = 50
"""Of a search for weights."""
_FIRST = (0.25, 0.5, 0.75)
_FURTHER = 2
_GRID = np.linspace(0.0, 1.0, 101)
_APART = 0.02
SAME_WEIGHTS = 0.15
"""As far apart, the weights of two mixtures are the same."""


@dataclass(frozen=True)
class Mixture:
    """Two known strategies together.

    Attributes
    ----------
    weights
        By name; they sum to 1.
    log_evidence
        Of the demonstration if some mixture of the two made it, all weights being as likely a priori; see
        `Courses.log_evidence`.
    episodes
        That were played to find them.
    """

    weights: dict[str, float]
    log_evidence: float
    episodes: int


def same_mixture(known: Mapping[str, Mapping[str, float]], weights: Mapping[str, float]) -> str | None:
    """The name of a known mixture with about these weights, if there is one."""
    for name, others in known.items():
        apart = [abs(others.get(part, 0.0) - weights.get(part, 0.0)) for part in {*others, *weights}]
        if max(apart) <= SAME_WEIGHTS:
            return name
    return None


def nearest_pair(
    courses: Courses, course: Array, may_mix: Callable[[str, str], bool]
) -> tuple[str, str] | None:
    """The two strategies between whose courses, on a straight line, a course ``[F]`` lies best.

    None if no two may be mixed. Nothing is played.
    """
    frame, best, found = courses.frame, np.inf, None
    here, centres = frame.along(courses.whitened(course)), frame.along(courses.centres)
    for first, name in enumerate(courses.names):
        for second in range(first + 1, len(courses.names)):
            if not may_mix(name, courses.names[second]):
                continue
            way = centres[second] - centres[first]
            share = float(np.clip((here - centres[first]) @ way / max(way @ way, 1e-12), 0.0, 1.0))
            rest = float(np.square(here - centres[first] - share * way).sum())
            if rest < best:
                best, found = rest, (name, courses.names[second])
    return found


def find_mixture(courses: Courses, course: Array, pair: tuple[str, str], play: Player) -> Mixture:
    """Weights of a pair by the divergence of its rollouts from a demonstration.

    What mixed policies do is no mean of what each does. So the course that they take is seen at a few
    weights and interpolated between those; then at the weights that look best, until all episodes are played.
    """
    rows = [courses.names.index(name) for name in pair]
    each = MOST_EPISODES // (len(_FIRST) + _FURTHER)
    seen = {0.0: courses.centres[rows[0]], 1.0: courses.centres[rows[1]]}

    def look(share: float) -> None:
        played = play({pair[0]: 1.0 - share, pair[1]: share}, each)
        seen[share] = courses.whitened(course_of(played))

    for share in _FIRST:
        look(share)
    for _ in range(_FURTHER):
        evidence = _along(courses, course, seen, each)
        # Nowhere twice: a neighbour tells more.
        free = np.min(np.abs(_GRID[:, None] - np.array(list(seen))), axis=1) > _APART
        look(float(_GRID[free][evidence[free].argmax()]))
    evidence = _along(courses, course, seen, each)
    best = float(_GRID[evidence.argmax()])
    return Mixture(
        {pair[0]: 1.0 - best, pair[1]: best},
        float(logsumexp(evidence) - np.log(len(_GRID))),
        each * (len(_FIRST) + _FURTHER),
    )


def _along(courses: Courses, course: Array, seen: dict[float, Array], count: int) -> Array:
    """Log evidence of a course on the way from one strategy to the other, on a grid of weights."""
    shares = sorted(seen)
    between = PchipInterpolator(shares, np.stack([seen[share] for share in shares]))(_GRID)
    return courses.log_evidence(course, between, count)
