"""Which strategies there are: the partition of the highest evidence, under the model that explains more."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from msrd_ros.learning.discovery.factors import factors
from msrd_ros.learning.discovery.mixture import Mixture, Spread, fitted_spread
from msrd_ros.learning.discovery.partition import STRONG, Labels, Partitions, canonical
from msrd_ros.learning.discovery.regression import Regressions
from msrd_ros.learning.discovery.same_policy import SamePolicy

Array = NDArray[np.float64]

SHARES = (1e-5, 1e-4, 1e-3, 1e-2, 0.1)
MOST_SHARE_OF_ONE_POLICY = 1e-3
"""Departures of at most a thirtieth of what strategies differ by: the demonstrations follow one policy."""
FACTORS = 3
"""Few, for the scatter within strategies has to be told from a handful of demonstrations each."""
FREEDOMS = (2.0, 16.0, 128.0)
RATIOS = (10.0, 30.0, 100.0)
_START_SPREADS = (0.003, 0.01, 0.03, 0.1)
_START_SLACKS = (0.0, 4.0 * STRONG)
"""Also from fewer groups than are best before the spread is known."""
_START_NUMBERS = (2, 3, 4, 6, 8, 12, 24)
_ANNEALING = (3.0, 2.0, 1.5, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0)
_TUNINGS = 3
_REHEATED = 2


class Found(NamedTuple):
    """A partition and what is thought of it.

    Attributes
    ----------
    score
        Log of evidence times prior.
    labels
        ``[N]``.
    partitions
        The search that it came of, for probabilities.
    """

    score: float
    labels: Labels
    partitions: Partitions


class Beliefs(NamedTuple):
    """What came with the demonstrations: labels ``[N]``, -1 none, and the probability that one is right."""

    given: Labels
    trust: float


def same_policy_partition(
    policies: Regressions, beliefs: Beliefs, rng: np.random.Generator
) -> tuple[Found, float]:
    """The best partition into single policies, and the share of departures under which it was found."""
    best, share = None, 0.0
    for candidate in SHARES:
        model = SamePolicy(policies, candidate)
        partitions = Partitions(model, beliefs.given, beliefs.trust)
        score, labels = partitions.agglomerate(np.arange(len(model.statistics)), STRONG)
        gain = np.inf if best is None else score + model.constant - best.score
        if gain > STRONG:
            best, share = Found(score + model.constant, labels, partitions), candidate
        if gain < -STRONG or share > MOST_SHARE_OF_ONE_POLICY:
            break
    assert best is not None
    if share <= MOST_SHARE_OF_ONE_POLICY:
        _, labels = best.partitions.move(best.labels, (0.0,) * 5, rng)
        best = best._replace(labels=labels)
    return best, share


def mixture_partition(ways: Regressions, beliefs: Beliefs, rng: np.random.Generator) -> Found:
    """The best partition into Gaussian groups of the factors in which demonstrations differ most."""
    values = factors(ways, min(FACTORS, len(ways.steps) - 1))
    ends = sorted(
        (_settled(values, start, beliefs, rng) for start in _starts(values, beliefs)),
        key=lambda end: -end.score,
    )
    for end in ends[:2]:
        for _ in range(_REHEATED):
            _, labels = end.partitions.move(end.labels, _ANNEALING, rng)
            ends.append(_settled(values, labels, beliefs, rng))
    return max(ends, key=lambda end: end.score)


def _starts(values: Array, beliefs: Beliefs) -> Iterable[Labels]:
    count, width = values.shape
    for spread in _START_SPREADS:
        freedom = width + 1 + FREEDOMS[1]
        model = Mixture(values, Spread(freedom * spread * np.eye(width), freedom, 1.0 / spread))
        partitions = Partitions(model, beliefs.given, beliefs.trust)
        for slack in _START_SLACKS:
            yield partitions.agglomerate(np.arange(count), slack)[1]
    tree = linkage(values, "ward")
    for number in _START_NUMBERS:
        if number < count / 1.5:
            yield canonical(fcluster(tree, number, "maxclust"))
    yield np.zeros(count, dtype=np.int64)


def _settled(values: Array, labels: Labels, beliefs: Beliefs, rng: np.random.Generator) -> Found:
    """Spread and partition in turn, until neither gets better."""
    best = _tuned(values, labels, beliefs)
    for _ in range(_TUNINGS):
        tuned = _tuned(values, labels, beliefs)
        _, moved = tuned.partitions.move(tuned.labels, (0.0,) * 5, rng)
        score, merged = tuned.partitions.agglomerate(moved)
        if score > best.score:
            best = Found(score, merged, tuned.partitions)
        if np.array_equal(merged, canonical(labels)):
            break
        labels = merged
    return best


def _tuned(values: Array, labels: Labels, beliefs: Beliefs) -> Found:
    """The spread of the highest evidence for a partition."""
    best = None
    for freedom in FREEDOMS:
        for ratio in RATIOS:
            spread = fitted_spread(values, labels, values.shape[1] + 1 + freedom, ratio)
            partitions = Partitions(Mixture(values, spread), beliefs.given, beliefs.trust)
            score = partitions.score(labels)
            if best is None or score > best.score:
                best = Found(score, canonical(labels), partitions)
    assert best is not None
    return best
