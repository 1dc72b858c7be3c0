"""Publishers told apart by the numbers of their messages."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.nodes.sources import FORGET_S, Sources


def count_after(messages: list[tuple[float, int]], wait_s: float = 0.0) -> int:
    sources = Sources()
    for time_s, number in messages:
        sources.add(number, time_s)
    return sources.count(messages[-1][0] + wait_s)


def stream(first: int, rate_hz: float, begin_s: float = 0.0, seconds: float = 5.0) -> list[tuple[float, int]]:
    return [(begin_s + index / rate_hz, first + index) for index in range(int(seconds * rate_hz))]


def test_one_publisher_is_one_with_gaps_and_when_it_is_started_again() -> None:
    assert count_after(stream(1, 250.0)) == 1
    rng = np.random.default_rng(0)
    assert count_after([message for message in stream(7, 250.0) if rng.random() < 0.5]) == 1
    again = [message for life in range(4) for message in stream(1, 50.0, begin_s=life, seconds=1.0)]
    assert count_after(again) == 1
    # The middleware that does not number anything tells nothing.
    assert count_after([(time_s, 0) for time_s, _ in stream(1, 50.0)]) == 1


@pytest.mark.parametrize("first", [1, 2, 40, 100_000])
@pytest.mark.parametrize("rate_hz", [2.0, 50.0, 250.0, 1000.0])
def test_two_that_go_on_side_by_side_are_two_until_one_is_gone(first: int, rate_hz: float) -> None:
    both = sorted(stream(1, 250.0) + stream(first, rate_hz, begin_s=0.0005))
    assert count_after(both) == 2
    assert count_after(both, wait_s=FORGET_S + 0.1) == 1
