"""Partitions of demonstrations into strategies: the prior over them, and the search for the best one.

The prior is that of a finite mixture whose number of components is not known (Miller and Harrison, 2018), all
numbers being as likely: unlike a Dirichlet process it does not go on making small groups of chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
"""Group of every demonstration, ``[N]``, numbered from 0 without a gap."""


STRONG = 3.0
"""Nats that speak strongly for a hypothesis (Kass and Raftery, 1995): asked of what is less simple."""


_NUMBERS_AT_ONCE = 200_000
"""Statistics of many groups at once do not fit a processor's cache."""


class Model(Protocol):
    """Groups whose evidence depends on a sum over their demonstrations.

    Attributes
    ----------
    statistics
        ``[N, F]``, what each demonstration adds to its group.
    """

    statistics: Array

    def log_evidence(self, statistics: Array, counts: Array) -> Array:
        """Of groups ``[C, F]`` of ``[C]`` demonstrations each, ``[C]``; 0 of an empty one."""


def canonical(labels: NDArray[np.integer]) -> Labels:
    """The same groups, numbered in the order in which they first appear."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.int64)


class Partitions:
    """Search over partitions by evidence times prior.

    Parameters
    ----------
    model
        Evidence of groups.
    given
        ``[N]`` label that came with each demonstration, -1: none.
    trust
        Probability that a given label is right.
    """

    def __init__(self, model: Model, given: Labels, trust: float) -> None:
        self._model, self._given, self._count = model, given, len(model.statistics)
        kinds = int(given.max(initial=-1)) + 1
        self._trust, self._kinds = trust, kinds
        votes = np.eye(kinds + 1)[given][:, :kinds]
        self._rows = np.concatenate([votes, model.statistics], axis=1)
        self._numbers = log_weights_of_numbers(self._count)

    def with_trust(self, trust: float) -> Partitions:
        """The same with another trust in given labels."""
        return Partitions(self._model, self._given, trust)

    def score(self, labels: NDArray[np.integer]) -> float:
        """Log of evidence times prior."""
        sums, counts = self._sums(canonical(labels))
        return float(self._evidence(sums, counts).sum() + self._numbers[len(counts)])

    def agglomerate(self, labels: NDArray[np.integer], slack: float = 0.0) -> tuple[float, Labels]:
        """The best of the partitions that come of always merging the best pair, from `labels` on.

        Parameters
        ----------
        slack
            Nats within which of the best one the partition of fewest groups is taken.
        """
        labels = canonical(labels)
        sums, counts = self._sums(labels)
        evidence = self._evidence(sums, counts)
        groups = len(counts)
        gains = np.full((groups, groups), -np.inf)
        for one in range(groups - 1):
            others = np.arange(one + 1, groups)
            gains[one, others] = self._gains(sums, counts, evidence, one, others)
        value = float(evidence.sum())
        scores, partitions = [value + self._numbers[groups]], [labels.copy()]
        alive = np.ones(groups, dtype=bool)
        for left in range(groups - 1, 0, -1):
            one, other = divmod(int(np.argmax(gains)), groups)
            value += float(gains[one, other])
            sums[one] += sums[other]
            counts[one] += counts[other]
            evidence[one] = self._evidence(sums[one : one + 1], counts[one : one + 1])[0]
            alive[other], labels[labels == other] = False, one
            gains[other], gains[:, other] = -np.inf, -np.inf
            others = np.flatnonzero(alive)
            others = others[others != one]
            new = self._gains(sums, counts, evidence, one, others)
            gains[np.minimum(one, others), np.maximum(one, others)] = new
            scores.append(value + self._numbers[left])
            partitions.append(labels.copy())
        last = int(np.flatnonzero(np.array(scores) >= max(scores) - slack)[-1])
        return float(scores[last]), canonical(partitions[last])

    def move(
        self, labels: NDArray[np.integer], temperatures: Sequence[float], rng: np.random.Generator
    ) -> tuple[float, Labels]:
        """Move demonstrations one by one: Gibbs sampling, at temperature 0 to the best group only."""
        groups = canonical(labels)
        for temperature in temperatures:
            before = groups.copy()
            for index in rng.permutation(self._count):
                scores = self.choices(groups, int(index))
                if temperature > 0.0:
                    chances = np.exp((scores - scores.max()) / temperature)
                    groups[index] = rng.choice(len(scores), p=chances / chances.sum())
                elif scores.max() > scores[groups[index]] + 1e-9:
                    groups[index] = np.argmax(scores)
                groups = canonical(groups)
            if temperature == 0.0 and np.array_equal(before, groups):
                break
        return self.score(groups), groups

    def choices(self, labels: Labels, index: int) -> Array:
        """Log-probabilities of one's group ``[groups + 1]``, a new one last, but for a constant."""
        sums, counts = self._sums(labels)
        sums = np.concatenate([sums, np.zeros((1, sums.shape[1]))])
        counts = np.append(counts, 0.0)
        own = labels[index]
        sums[own] -= self._rows[index]
        counts[own] -= 1.0
        if counts[own] == 0.0:
            sums[own] = 0.0
        left = int((counts > 0.0).sum())
        gains = self._evidence(sums + self._rows[index], counts + 1.0) - self._evidence(sums, counts)
        gains += np.where(counts > 0.0, self._numbers[left], self._numbers[min(left + 1, self._count)])
        if counts[own] == 0.0:
            gains[-1] = -np.inf
        return gains

    def responsibilities(self, labels: Labels) -> Array:
        """``[N, groups + 1]``: probability of each group given where the others are, a new one last."""
        scores = np.stack([self.choices(labels, index) for index in range(self._count)])
        return np.asarray(np.exp(scores - logsumexp(scores, axis=1, keepdims=True)))

    def _sums(self, labels: Labels) -> tuple[Array, Array]:
        member = np.eye(int(labels.max()) + 1)[labels]
        return member.T @ self._rows, member.sum(axis=0)

    def _gains(self, sums: Array, counts: Array, evidence: Array, one: int, others: Labels) -> Array:
        merged = self._evidence(sums[one] + sums[others], counts[one] + counts[others])
        return np.asarray(merged - evidence[one] - evidence[others])

    def _evidence(self, sums: Array, counts: Array) -> Array:
        votes, statistics = sums[:, : self._kinds], sums[:, self._kinds :]
        piece = max(1, _NUMBERS_AT_ONCE // max(1, statistics.shape[1]))
        found = [
            self._model.log_evidence(statistics[start : start + piece], counts[start : start + piece])
            for start in range(0, len(counts), piece)
        ]
        evidence = np.concatenate([*found, np.zeros(0)])
        return np.asarray(evidence + gammaln(counts + 1.0) + self._log_votes(votes))

    def _log_votes(self, votes: Array) -> Array:
        """Of given labels in a group of one unknown name, all names being as likely."""
        if self._kinds < 2:
            return np.zeros(len(votes))
        wrong = (1.0 - self._trust) / (self._kinds - 1)
        total = votes.sum(axis=1, keepdims=True)
        each = votes * np.log(self._trust) + (total - votes) * np.log(wrong)
        return np.asarray(logsumexp(each, axis=1) - np.log(self._kinds))


def log_weights_of_numbers(count: int) -> Array:
    """``[count + 1]``: log-weight of a partition of `count` things by its number of groups.

    The weight ``V_N(t)`` of Miller and Harrison (2018, eq. 3.2) with a flat Dirichlet over proportions, and
    all numbers of components up to `count` as likely.
    """
    components = np.arange(1, count + 1, dtype=np.float64)
    weights = np.full(count + 1, -np.inf)
    for groups in range(1, count + 1):
        possible = components[groups - 1 :]
        falling = gammaln(possible + 1.0) - gammaln(possible - groups + 1.0)
        rising = gammaln(possible + count) - gammaln(possible)
        weights[groups] = logsumexp(falling - rising) - np.log(count)
    return weights
