"""Two strokes with their hits at the same time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.explain.comparison import compare
from msrd_ros.explain.explanation import Explanation


def test_a_stroke_beside_itself_is_the_same(unseen: list[Explanation]) -> None:
    found = compare(unseen[0], unseen[0])
    for pair in (found.ball, found.paddle, found.task, found.strategy):
        assert np.array_equal(pair[0], pair[1])
    assert not found.ball_apart_m.any()
    assert not found.paddle_apart_m.any()


def test_a_stroke_beside_itself_played_later_is_the_same(unseen: list[Explanation]) -> None:
    one = unseen[0]
    later = replace(one, time_s=one.time_s + 0.1, hit_s=one.hit_s + 0.1)
    found = compare(one, later)
    assert np.allclose(found.ball[0], found.ball[1], atol=1e-9)
    assert np.allclose(found.task[0], found.task[1], atol=1e-9)


def test_times_count_from_both_hits_as_long_as_both_go_on(unseen: list[Explanation]) -> None:
    first, second = unseen[0], unseen[3]
    found = compare(first, second)
    assert np.abs(found.time_s).min() < 1e-12
    assert np.allclose(np.diff(found.time_s), CONTROL_PERIOD_S)
    for one in (first, second):
        assert one.time_s[0] - 1e-9 <= found.time_s[0] + one.hit_s
        assert found.time_s[-1] + one.hit_s <= one.time_s[-1] + 1e-9
    assert found.strategy.shape == (2, len(found.time_s), len(first.labels))


def test_values_at_the_hit_are_those_of_each_stroke(unseen: list[Explanation]) -> None:
    first, second = unseen[0], unseen[3]
    found = compare(first, second)
    at_hit = int(np.abs(found.time_s).argmin())
    for row, one in enumerate((first, second)):
        expected = [np.interp(one.hit_s, one.time_s, one.paddle[:, axis]) for axis in range(3)]
        assert np.allclose(found.paddle[row, at_hit], expected)
    apart = np.linalg.norm(found.paddle[0, at_hit] - found.paddle[1, at_hit])
    assert found.paddle_apart_m[at_hit] == pytest.approx(apart)


def test_rewards_of_other_strategies_cannot_be_compared(unseen: list[Explanation]) -> None:
    with pytest.raises(ValueError, match="explained by rewards of"):
        compare(unseen[0], replace(unseen[1], labels=("one", "two")))
