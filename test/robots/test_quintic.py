"""Strokes of the joints with a lead-in and a place to rest, and their smoothest rates at the hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.robots.quintic import JointStroke, minimum_jerk_velocity, stroke_from_rest

READY, WIND_UP, HIT, END = (np.array(pair) for pair in ([0.0, 0.3], [-0.4, 0.1], [0.2, 0.6], [0.5, 0.5]))
DURATIONS = st.floats(0.1, 1.0)
ANGLES = st.floats(-1.0, 1.0)


def _stroke() -> JointStroke:
    rates = np.array([2.0, -1.0])
    stroke = stroke_from_rest(WIND_UP, 0.9, HIT, rates, swing_s=0.4, follow_s=0.3)
    lead_in = stroke_from_rest(READY, 0.5, WIND_UP, np.zeros(2), swing_s=0.3, follow_s=0.1)
    return replace(stroke, end_position=END, lead_in=lead_in)


def test_a_stroke_passes_all_its_places() -> None:
    stroke = _stroke()
    assert (stroke.first_time_s, stroke.end_time_s) == pytest.approx((0.2, 1.2))
    for time, place in ((0.0, READY), (0.2, READY), (0.5, WIND_UP), (0.9, HIT), (1.2, END), (9.0, END)):
        np.testing.assert_allclose(stroke.at(time).position, place, atol=1e-12)
    np.testing.assert_allclose(stroke.at(0.9).velocity, [2.0, -1.0])
    for time in (0.2, 0.5, 1.2):
        assert np.abs(stroke.at(time).velocity).max() < 1e-9


def test_a_stroke_with_a_lead_in_is_smooth() -> None:
    stroke, step = _stroke(), 1e-4
    states = stroke.sample(np.arange(0.1, 1.3, step))
    mean = 0.5 * (states.velocity[1:] + states.velocity[:-1])
    np.testing.assert_allclose(np.diff(states.position, axis=0) / step, mean, atol=1e-4)
    assert np.abs(np.diff(states.acceleration, axis=0)).max() < 0.2


def test_another_hit_leaves_the_lead_in_until_it_is_over() -> None:
    stroke = _stroke()
    early = stroke.continued_from(0.35, 0.92, HIT + 0.1, np.ones(2))
    np.testing.assert_array_equal(early.at(0.4).position, stroke.at(0.4).position)
    np.testing.assert_allclose(early.at(0.92).position, HIT + 0.1)
    late = stroke.continued_from(0.7, 0.92, HIT + 0.1, np.ones(2))
    np.testing.assert_array_equal(late.at(0.7).velocity, stroke.at(0.7).velocity)
    assert late.lead_in is None


def _jerk(stroke: JointStroke) -> float:
    """Integral of the squared jerk, from differences of the accelerations."""
    times = np.linspace(stroke.start_time_s, stroke.end_time_s, 2001)
    rates = np.diff(stroke.sample(times).acceleration, axis=0) / (times[1] - times[0])
    return float(np.sum(rates**2) * (times[1] - times[0]))


@given(ANGLES, ANGLES, DURATIONS, DURATIONS)
def test_no_other_rate_at_the_hit_is_smoother(
    start: float, end: float, swing_s: float, follow_s: float
) -> None:
    first, hit, last = (np.array([value]) for value in (start, 0.0, end))
    rate = minimum_jerk_velocity(first, hit, last, swing_s, follow_s)
    jerks = []
    for factor in (-0.05, 0.0, 0.05):
        stroke = stroke_from_rest(first, 2.0, hit, rate + factor, swing_s=swing_s, follow_s=follow_s)
        jerks.append(_jerk(replace(stroke, end_position=last)))
    assert jerks[1] <= min(jerks[0], jerks[2])
