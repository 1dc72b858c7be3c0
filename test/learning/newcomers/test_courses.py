"""Courses of known strategies, and evidence of demonstrations under them."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.learning.newcomers.courses import Courses
from msrd_ros.learning.newcomers.frame import course_of
from newcomer_problems import COLUMNS, NAMES, fitted, place_of, walks


def test_known_ones_are_told_and_strangers_are_strange() -> None:
    rng = np.random.default_rng(0)
    courses = fitted(rng)
    surer = []
    for row in range(4):
        for walk in walks(place_of(row), 10, rng):
            evidence = courses.known_evidence(course_of([walk]))
            assert evidence.argmax() == row
            surer.append(evidence.max() > courses.strange_evidence(course_of([walk])))
    assert np.mean(surer) >= 0.9
    for walk in walks(place_of(4), 10, rng):
        course = course_of([walk])
        assert courses.strange_evidence(course) > courses.known_evidence(course).max()


def test_strategies_come_and_go() -> None:
    rng = np.random.default_rng(1)
    courses = fitted(rng)
    course = course_of(walks(place_of(4), 2, rng))
    more = courses.with_strategy("fifth", course, 2)
    assert more.names == (*NAMES, "fifth")
    assert more.known_evidence(course).argmax() == 4
    assert more.without("fifth").names == courses.names
    assert np.array_equal(more.without("fifth").centres, courses.centres)
    moved = courses.with_member("third", course, 8)
    assert np.allclose(moved.centres[2], (courses.centres[2] + courses.whitened(course)) / 2)
    assert moved.counts.tolist() == [8, 8, 16, 8]


def test_units_of_columns_do_not_matter() -> None:
    rng = np.random.default_rng(2)
    seen = [walk for number in range(4) for walk in walks(place_of(number), 8, rng)]
    labels = [name for name in NAMES for _ in range(8)]
    unit = np.array([1000.0, 1e-3, 1.0, 1.0, 10.0, 1.0])
    plain, scaled = Courses.fit(seen, labels), Courses.fit([walk * unit for walk in seen], labels)
    course = course_of(walks(place_of(1), 1, rng))
    first, second = plain.known_evidence(course), scaled.known_evidence(course * np.tile(unit, 8))
    assert np.allclose(first, second, rtol=1e-3)


def test_people_who_differ_widen_what_is_usual() -> None:
    rng = np.random.default_rng(3)
    seen, labels, people = [], [], []
    for person in range(6):
        manner = 0.5 * rng.standard_normal(COLUMNS)
        for number in range(2):
            for walk in walks(place_of(number), 3, rng):
                seen.append(walk + manner)
                labels.append(NAMES[number])
                people.append(f"person {person}")
    alone, together = Courses.fit(seen, labels), Courses.fit(seen, labels, people)
    assert np.trace(together.usual.spread) > np.trace(alone.usual.spread)


def test_too_little_is_refused() -> None:
    rng = np.random.default_rng(4)
    with pytest.raises(UserError, match="one strategy is known"):
        Courses.fit(walks(place_of(0), 4, rng), ["only"] * 4)
    one, other = (walks(place_of(number), 1, rng)[0] for number in range(2))
    with pytest.raises(UserError, match="too few demonstrations"):
        Courses.fit([one, other], ["a", "b"])
    with pytest.raises(UserError, match="demonstration 1 has 5 states"):
        Courses.fit([one, other[:5]], ["a", "b"])
