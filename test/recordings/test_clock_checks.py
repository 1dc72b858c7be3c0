"""Clocks that stand still, and ticks that are only told once more."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.recordings.clock_checks import check_clocks
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.samples import StrokeSamples, Track
from msrd_ros.recordings.verdict import Finding, Refusal

PERIOD_NS = 20_000_000
ROWS = 40
FIRST_STILL = 20


def findings(period_s: float, moves: bool, times: int = 4) -> list[Finding]:
    """What is found where a stamp is told some times more, so far apart, of an arm that moves or not."""
    still = slice(FIRST_STILL, FIRST_STILL + times)
    stamps = PERIOD_NS * np.arange(ROWS)
    received = stamps.copy()
    received[still.start :] += round(period_s * 1e9) * np.minimum(np.arange(1, ROWS - still.start + 1), times)
    values = np.linspace(0.0, 1.0, ROWS)[:, None] * np.ones(7)
    stamps[still] = stamps[still.start - 1]
    if not moves:
        values[still] = values[still.start - 1]
    rows = np.arange(ROWS)
    joints = Track("joint_states", stamps, received, received, rows, values, np.zeros_like(values))
    ball = joints.select(rows < 0)
    return list(check_clocks(StrokeSamples(joints, ball), 0, InspectionLimits()))


def test_a_tick_that_is_told_once_more_while_its_answer_is_late_is_no_clock() -> None:
    assert findings(0.25, moves=False) == []


def test_the_first_picture_of_a_flight_may_come_late_with_the_stamp_of_the_launch() -> None:
    assert findings(0.4, moves=True, times=1) == []


@pytest.mark.parametrize(("period_s", "moves"), [(0.25, True), (0.03, True), (0.03, False)])
def test_stamps_that_stand_while_it_goes_on_are_refused(period_s: float, moves: bool) -> None:
    (finding,) = findings(period_s, moves)
    assert finding.reason is Refusal.BAD_CLOCK
    assert "stand still" in finding.text
