"""Where an arm rests: told by measurements that agree for a while."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from msrd_ros.robots.rest import AGREE_RAD, AGREE_S, GAP_S, RestFinder

HERE = np.array([0.3, -1.0, 0.5])
PERIOD_S = 0.02


def test_an_arm_that_stays_is_found_after_a_while() -> None:
    finder = RestFinder()
    found = [finder.see(HERE + 0.1 * AGREE_RAD * (step % 2), PERIOD_S * step) for step in range(10)]
    assert found == [PERIOD_S * step >= AGREE_S for step in range(10)]


@example([False, *[True] * 6])  # 0.12 s - 0.02 s is a little less than 0.1 s
@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_nothing_is_found_where_not_all_of_the_last_tell_the_same(elsewhere: list[bool]) -> None:
    finder = RestFinder()
    steps = round(AGREE_S / PERIOD_S)
    for step, other in enumerate(elsewhere):
        found = finder.see(HERE[::-1] if other else HERE, PERIOD_S * step)
        last = elsewhere[max(step - steps, 0) : step + 1]
        assert found == (len(last) == steps + 1 and len(set(last)) == 1)


def test_silence_and_what_cannot_be_begin_anew() -> None:
    finder = RestFinder()
    for step in range(10):
        finder.see(HERE, PERIOD_S * step)
    assert not finder.see(HERE, PERIOD_S * 9 + 1.1 * GAP_S)
    finder = RestFinder()
    for step in range(10):
        finder.see(HERE, PERIOD_S * step)
    finder.forget()
    assert not finder.see(HERE, PERIOD_S * 10)
