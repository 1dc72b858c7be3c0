"""Beliefs: what labels do to them, what is played for them, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from msrd_ros.learning.newcomers.frame import course_of
from msrd_ros.learning.newcomers.mixtures import MOST_EPISODES, Player, find_mixture, nearest_pair
from msrd_ros.learning.newcomers.recognition import Recognition, Verdict, recognise
from newcomer_problems import NAMES, fitted, place_of, walks


def player(rng: np.random.Generator, played: list[dict[str, float]]) -> Player:
    """Mixtures that bend: the place of a mean is not the mean of the places."""

    def play(weights: dict[str, float], episodes: int) -> list[NDArray[np.floating]]:
        played.append(weights)
        first, second = weights
        share = weights[second] ** 2
        place = (1.0 - share) * place_of(NAMES.index(first)) + share * place_of(NAMES.index(second))
        return list(walks(place, episodes, rng))

    return play


HALF_WAY = 0.5 * (place_of(1) + place_of(2))


def test_weights_are_those_whose_rollouts_come_nearest() -> None:
    rng = np.random.default_rng(0)
    played: list[dict[str, float]] = []
    courses = fitted(rng)
    course = course_of(walks(HALF_WAY, 1, rng))
    pair = nearest_pair(courses, course, lambda first, second: True)
    assert pair == ("second", "third")
    found = find_mixture(courses, course, pair, player(rng, played))
    assert found.weights["third"] == pytest.approx(np.sqrt(0.5), abs=0.12)
    assert sum(found.weights.values()) == pytest.approx(1.0)
    assert found.episodes <= MOST_EPISODES
    assert len({weights["third"] for weights in played}) == len(played)


def test_only_pairs_that_may_be_mixed_are() -> None:
    rng = np.random.default_rng(1)
    courses = fitted(rng)
    course = course_of(walks(HALF_WAY, 1, rng))
    assert nearest_pair(courses, course, lambda first, second: first == "first") in {
        ("first", "second"),
        ("first", "third"),
    }
    assert nearest_pair(courses, course, lambda first, second: False) is None


@pytest.mark.parametrize(
    ("place", "verdict"),
    [(place_of(3), Verdict.KNOWN), (HALF_WAY, Verdict.MIXTURE), (place_of(5), Verdict.NEW)],
)
def test_verdicts(place: NDArray[np.float64], verdict: Verdict) -> None:
    rng = np.random.default_rng(2)
    played: list[dict[str, float]] = []
    courses = fitted(rng)
    found = recognise(courses, walks(place, 1, rng), player(rng, played))
    assert found.verdict is verdict
    assert found.belief > 0.6
    assert sum(found.known.values()) + found.mixture + found.new == pytest.approx(1.0)
    assert found.episodes == 10 * len(played)


def test_a_label_moves_beliefs_but_does_not_decide() -> None:
    rng = np.random.default_rng(3)
    courses = fitted(rng)
    shown = walks(place_of(2), 1, rng)
    without, right, wrong, fresh = (
        recognise(courses, shown, player(np.random.default_rng(4), []), label)
        for label in (None, "third", "first", "never heard of")
    )
    assert right.known["third"] >= without.known["third"] > fresh.known["third"]
    assert wrong.strategy == fresh.strategy == "third"


def test_what_is_said() -> None:
    found = Recognition(Verdict.MIXTURE, 0.9, {"a": 0.05, "b": 0.0}, 0.9, 0.05, {"a": 0.25, "b": 0.75}, 50)
    assert str(found) == "mixture: 0.25 a + 0.75 b (belief 0.90)"
    assert found.to_dict()["weights"] == {"a": 0.25, "b": 0.75}
    known = Recognition(Verdict.KNOWN, 0.7, {"a": 0.7, "b": 0.1}, 0.1, 0.1, {}, 0)
    assert str(known) == "known: a (belief 0.70)"
    new = Recognition(Verdict.NEW, 0.6, {"a": 0.3, "b": 0.1}, 0.0, 0.6, {}, 0)
    assert str(new) == "new, nearest to a (belief 0.60)"
