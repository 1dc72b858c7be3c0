"""Which strategies there are: the partition of the highest evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from msrd_ros.learning.discovery.mixture import Mixture, Spread
from msrd_ros.learning.discovery.partition import STRONG, Labels, Partitions, canonical
from msrd_ros.learning.discovery.same_policy import Regressions, SamePolicy

Array = NDArray[np.float64]

RATIOS_OF_WEIGHTS = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6)
SHARES = (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.3)
MOST_DEPARTURES_OF_ONE_POLICY = 100.0
"""Variance of departures in units of the noise's. With more, noise hardly hides them, and each demonstration
is a policy of its own, however many its steps."""
FREEDOM = 8.0
"""Of the groups' covariances, beyond the least: how alike they are."""
SCATTERS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Of groups, in parts of the variance over all demonstrations."""
RATIOS_OF_MEANS = (3.0, 10.0, 30.0, 100.0)
_SLACKS = (0.0, 2.0 * STRONG)
"""Also from fewer groups than are best under a spread."""
_ROUNDS = 3
_MOVES = (0.0,) * 5


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

    def over(self, model: SamePolicy | Mixture) -> Partitions:
        """Partitions under a model."""
        return Partitions(model, self.given, self.trust)


def evidence_alone(regressions: Regressions, beliefs: Beliefs) -> float:
    """The highest log-evidence of demonstrations one by one: by it features are held against each other."""
    alone = np.arange(len(regressions.steps))
    chosen = _likeliest(regressions, beliefs, alone, SHARES[:1])
    return beliefs.over(SamePolicy(regressions, *chosen)).score(alone)


def same_policy_partition(
    regressions: Regressions, beliefs: Beliefs, rng: np.random.Generator
) -> tuple[Found, float]:
    """The best partition into single policies, and the departures in units of noise under which it was found.

    Partition and variances in turn, from those that are likeliest if every demonstration is a strategy of its
    own without departures, and from those that are if there is one strategy.
    """
    alone = np.arange(len(regressions.steps))
    best, departures, tried = None, 0.0, set()
    for start, shares in ((alone, SHARES[:1]), (np.zeros_like(alone), SHARES)):
        labels = start
        for _ in range(_ROUNDS):
            chosen = _likeliest(regressions, beliefs, labels, shares if labels is start else SHARES)
            if chosen in tried:
                break
            tried.add(chosen)
            partitions = beliefs.over(SamePolicy(regressions, *chosen))
            score, labels = partitions.agglomerate(alone, STRONG)
            if best is None or score > best.score:
                best, departures = Found(score, labels, partitions), math.prod(chosen)
    assert best is not None
    if departures <= MOST_DEPARTURES_OF_ONE_POLICY:
        score, labels = best.partitions.move(best.labels, _MOVES, rng)
        best = best._replace(score=score, labels=labels)
    return best, departures


def _likeliest(
    regressions: Regressions, beliefs: Beliefs, labels: Labels, shares: Sequence[float]
) -> tuple[float, float]:
    """Ratio and share of the highest evidence for a partition."""
    return max(
        product(RATIOS_OF_WEIGHTS, shares),
        key=lambda pair: beliefs.over(SamePolicy(regressions, *pair)).score(labels),
    )


def mixture_partition(values: Array, beliefs: Beliefs, rng: np.random.Generator) -> Found:
    """The best partition of ``[N, q]`` into Gaussian groups, how far they scatter being integrated out.

    Each spread proposes partitions; all are held against each other by their evidence under all spreads
    together, since a spread that is fitted to the partition that it judges finds ever smaller groups. There
    is one strategy unless something speaks strongly against it. The result is thought of under the spread
    that makes it likeliest.
    """
    count, width = values.shape
    total = float(values.var(axis=0).mean()) or 1.0
    spreads = [
        Spread(FREEDOM * part * total * np.eye(width), width + 1 + FREEDOM, ratio)
        for part, ratio in product(SCATTERS, RATIOS_OF_MEANS)
    ]
    searches = [beliefs.over(Mixture(values, spread)) for spread in spreads]
    proposed = [np.zeros(count, dtype=np.int64)]
    for partitions, slack in product(searches, _SLACKS):
        _, labels = partitions.agglomerate(np.arange(count), slack)
        proposed.append(canonical(partitions.move(labels, _MOVES, rng)[1]))
    different = list({labels.tobytes(): labels for labels in proposed}.values())
    scores = np.array(
        [
            [
                partitions.score(labels) + spread.log_weight_of_centre(np.bincount(labels))
                for partitions, spread in zip(searches, spreads, strict=True)
            ]
            for labels in different
        ]
    )
    evidence = logsumexp(scores, axis=1) - np.log(len(searches))
    one_strategy = evidence[0] >= evidence.max() - STRONG
    best = 0 if one_strategy else int(np.argmax(evidence))
    return Found(float(evidence[best]), different[best], searches[int(np.argmax(scores[best]))])
