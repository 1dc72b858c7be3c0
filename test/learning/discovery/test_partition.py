"""The prior over partitions sums to one, and the search finds the best partition of a few things."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from msrd_ros.learning.discovery.mixture import Mixture, Spread
from msrd_ros.learning.discovery.partition import Partitions, canonical, log_weights_of_numbers

NONE = np.full(6, -1)


def partitions_of(count: int) -> Iterator[NDArray[np.int64]]:
    """All of them, by restricted growth."""

    def grow(start: list[int]) -> Iterator[list[int]]:
        if len(start) == count:
            yield start
            return
        for label in range(max(start, default=-1) + 2):
            yield from grow([*start, label])

    for labels in grow([]):
        yield np.array(labels)


class Nothing:
    """Demonstrations that say nothing."""

    def __init__(self, count: int) -> None:
        self.statistics = np.zeros((count, 1))

    def log_evidence(
        self, statistics: NDArray[np.float64], counts: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """None."""
        return np.zeros(len(counts))


def test_the_prior_of_all_partitions_sums_to_one() -> None:
    search = Partitions(Nothing(6), NONE, 0.7)
    total = sum(np.exp(search.score(labels)) for labels in partitions_of(6))
    assert total == pytest.approx(1.0)


def test_what_says_nothing_is_one_group() -> None:
    search = Partitions(Nothing(6), NONE, 0.7)
    assert max(partitions_of(6), key=search.score).max() == 0
    assert search.agglomerate(np.arange(6))[1].max() == 0
    assert log_weights_of_numbers(6)[0] == -np.inf


def test_search_finds_the_best_of_all_partitions() -> None:
    rng = np.random.default_rng(4)
    values = np.repeat([[-3.0, 0.0], [0.0, 3.0], [3.0, 0.0]], 2, axis=0) + 0.3 * rng.normal(size=(6, 2))
    search = Partitions(Mixture(values, Spread(0.5 * np.eye(2), 6.0, 30.0)), NONE, 0.7)
    best = max(partitions_of(6), key=search.score)
    assert best.max() == 2
    score, labels = search.agglomerate(np.arange(6))
    assert np.array_equal(labels, canonical(best))
    assert score == pytest.approx(search.score(best))
    moved, labels = search.move(np.zeros(6, dtype=np.int64), (2.0, 1.0, 1.0, 0.0, 0.0, 0.0), rng)
    assert moved <= score + 1e-9


def test_the_choices_of_one_demonstration_are_differences_of_scores() -> None:
    rng = np.random.default_rng(5)
    given = np.array([0, 0, 1, -1, 1, 0])
    search = Partitions(Mixture(rng.normal(size=(6, 2)), Spread(np.eye(2), 6.0, 10.0)), given, 0.8)
    labels = np.array([0, 0, 1, 1, 2, 2])
    choices = search.choices(labels, 3)
    scores = [search.score(np.where(np.arange(6) == 3, group, labels)) for group in range(4)]
    assert choices - choices[0] == pytest.approx(np.array(scores) - scores[0])
    assert search.responsibilities(labels).sum(axis=1) == pytest.approx(np.ones(6))
