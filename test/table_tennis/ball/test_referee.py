"""The referee's decisions, each case played by a real ball, and outcomes as text."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from msrd_ros.contract.outcome import RETURNED, MissReason, Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.flight import ball_state
from msrd_ros.table_tennis.ball.referee import new_referees, outcome_of
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE

CONSTANTS = Scene().constants()

FEED = ball_state((1.0, 0.0, 1.1), (-4.8, 0.0, 1.4))
"""Bounces once at x = -0.98 and leaves the table over the robot's end line."""

RETURN = np.array([3.6, 0.3, 2.6, 0.0, 30.0, 0.0])
"""Velocity and spin after a hit behind the end line that bring it back onto the far half."""


def play(
    ball: np.ndarray, hit_state: np.ndarray | None = None, hit_x: float = -1.5, longest: float = 4.0
) -> Outcome:
    """Play a ball; when it passes `hit_x` towards the robot, a paddle sends it off with velocity and spin.

    The paddle is a real one that is put in the ball's way; what it makes of the ball is overwritten by
    `hit_state` (velocity and spin, six floats), so that every case can be reached.
    """
    ball, referee, hit = ball.copy(), new_referees(1), False
    for index in range(round(longest / 0.002)):
        paddle = NO_PADDLE
        if hit_state is not None and not hit and ball[0] < hit_x:
            centre = ball[:3] - np.array([0.0265, 0.0, 0.0])
            paddle = np.array([*centre, 1.0, 0.0, 0.0, *np.zeros(6)])
            hit = True
        step_ball(ball, referee, paddle, paddle, index * 0.002, 0.002, CONSTANTS)
        if paddle is not NO_PADDLE:
            assert referee[0]["hits"] == 1
            ball[3:] = hit_state
        if referee[0]["verdict"]:
            break
    return outcome_of(referee, ball_id=7)


def test_a_ball_onto_the_far_half_is_returned() -> None:
    outcome = play(FEED, RETURN)
    assert outcome.returned
    assert outcome.struck
    assert outcome.message == RETURNED
    assert outcome.ball_id == 7
    assert 0.0 < outcome.landing_x_m < 1.37
    assert 0.0 < outcome.landing_y_m < 0.5
    assert 0.5 < outcome.hit_time_s < outcome.decision_time_s < 2.0
    assert math.isfinite(outcome.spin_y_rad_s)
    assert outcome.velocity_x_m_s > 0.0


def test_spin_and_speed_are_those_right_after_the_racket() -> None:
    """No spin, head on: a paddle at rest with a tilted blade."""
    ball, referee = ball_state((-1.45, 0.0, 1.0), (-3.0, 0.0, 0.0), (0.0, -40.0, 0.0)), new_referees(1)
    referee["own_bounces"] = 1
    normal = np.array([math.cos(0.3), 0.0, math.sin(0.3)])
    paddle = np.array([-1.55, 0.0, 1.0, *normal, *np.zeros(6)])
    last = ball.copy()
    for index in range(100):
        step_ball(ball, referee, paddle, paddle, index * 0.001, 0.001, CONSTANTS)
        if referee[0]["hits"]:
            break
        last = ball.copy()
    outcome = outcome_of(referee, 0)
    assert outcome.hit_time_s == pytest.approx((index + 0.5) * 0.001, abs=0.0006)
    assert outcome.spin_y_rad_s == ball[7]
    assert outcome.velocity_x_m_s == pytest.approx(ball[3], abs=0.02)
    # Slip of the contact point before, reversed after.
    slip = [
        state[3:6] - (state[3:6] @ normal) * normal + np.cross(state[6:9], -0.02 * normal)
        for state in (last, ball)
    ]
    np.testing.assert_allclose(slip[1], (1 - 2.5 * 1.84e-3 / 0.0027) * slip[0], atol=0.03)


@pytest.mark.parametrize(
    ("hit", "reason"),
    [
        ((3.2, 0.0, 2.3), MissReason.NET),
        ((1.2, 0.0, 1.0), MissReason.OWN_HALF),
        ((-1.0, 0.0, 0.5), MissReason.OWN_HALF),
        ((9.0, 0.0, 2.5), MissReason.LONG),
        ((3.8, 1.8, 2.6), MissReason.WIDE),
        ((3.8, -1.8, 2.6), MissReason.WIDE),
    ],
)
def test_a_struck_ball_that_does_not_land_on_the_far_half(
    hit: tuple[float, float, float], reason: MissReason
) -> None:
    outcome = play(FEED, np.array([*hit, 0.0, 0.0, 0.0]))
    assert outcome.struck
    assert not outcome.returned
    assert outcome.miss_reason is reason
    assert outcome.message == reason.value
    assert math.isnan(outcome.landing_x_m)
    assert outcome.net_touched == (reason is MissReason.NET)
    assert outcome.decision_time_s > outcome.hit_time_s


def test_a_ball_that_clips_the_net_and_drops_over_is_returned() -> None:
    clipped = 0
    for upward in np.linspace(2.44, 2.54, 41):
        outcome = play(FEED, np.array([3.2, 0.0, upward, 0.0, 0.0, 0.0]))
        if outcome.net_touched and outcome.returned:
            clipped += 1
            assert 0.0 < outcome.landing_x_m < 1.37
    assert clipped > 0


def test_an_untouched_ball_is_missed_and_decided_on_the_floor() -> None:
    outcome = play(FEED)
    assert outcome.miss_reason is MissReason.MISSED
    assert not outcome.struck
    assert math.isnan(outcome.hit_time_s)
    assert math.isnan(outcome.spin_y_rad_s)


def test_two_bounces_on_the_robots_half_lose_the_ball_before_a_hit() -> None:
    lob = ball_state((0.8, 0.0, 1.2), (-1.8, 0.0, 2.0))
    assert play(lob).miss_reason is MissReason.DOUBLE_BOUNCE
    assert play(lob, np.array([3.6, 0.0, 2.0, 0, 0, 0]), hit_x=-1.4).miss_reason is MissReason.DOUBLE_BOUNCE


def test_a_ball_struck_before_its_bounce_is_a_volley() -> None:
    outcome = play(FEED, np.array([3.6, 0.0, 2.0, 0.0, 0.0, 0.0]), hit_x=-0.6)
    assert outcome.miss_reason is MissReason.VOLLEY
    assert outcome.struck
    assert outcome.decision_time_s == outcome.hit_time_s


def test_a_ball_struck_twice_is_a_double_hit() -> None:
    ball, referee = ball_state((-1.45, 0.0, 1.1)), new_referees(1)
    referee["own_bounces"] = 1
    up = np.array([-1.45, 0.0, 1.0, 0.0, 0.0, 1.0, *np.zeros(6)])
    for index in range(2000):
        step_ball(ball, referee, up, up, index * 0.001, 0.001, CONSTANTS)
        if referee[0]["verdict"]:
            break
    outcome = outcome_of(referee, 0)
    assert outcome.miss_reason is MissReason.DOUBLE_HIT
    assert outcome.decision_time_s > outcome.hit_time_s


def test_feeds_that_never_reach_the_robots_half_are_the_feeders_fault() -> None:
    short = ball_state((1.3, 0.0, 1.0), (-1.0, 0.0, 0.0))
    beside = ball_state((1.3, 0.0, 1.0), (-3.0, 3.0, 0.0))
    assert play(short).miss_reason is MissReason.BAD_FEED
    assert play(beside).miss_reason is MissReason.BAD_FEED


def test_what_happens_after_the_decision_changes_nothing() -> None:
    referee, ball = new_referees(1), FEED.copy()
    for index in range(2000):
        step_ball(ball, referee, NO_PADDLE, NO_PADDLE, index * 0.001, 0.001, CONSTANTS)
    decided = outcome_of(referee, 0)
    ball[:] = ball_state((0.5, 0.0, 0.9))
    for index in range(2000):
        step_ball(ball, referee, NO_PADDLE, NO_PADDLE, 2.0 + index * 0.001, 0.001, CONSTANTS)
    assert repr(outcome_of(referee, 0)) == repr(decided)


def test_a_rally_that_is_cut_off_is_undecided_and_times_count_from_the_launch() -> None:
    assert play(FEED, longest=0.3).miss_reason is MissReason.UNDECIDED
    ball, referee = FEED.copy(), new_referees(1)
    for index in range(2000):
        step_ball(ball, referee, NO_PADDLE, NO_PADDLE, 10.0 + index * 0.001, 0.001, CONSTANTS)
    late = outcome_of(referee, 0, launch_time=10.0)
    assert late.decision_time_s == pytest.approx(play(FEED).decision_time_s, abs=1e-6)


def test_outcomes_read_back_exactly_from_text() -> None:
    outcome = play(FEED, RETURN)
    assert Outcome.from_values(outcome.message, outcome.to_values()) == outcome
    missed = play(FEED)
    read = Outcome.from_values(missed.message, missed.to_values())
    assert repr(read) == repr(missed)


@pytest.mark.parametrize(
    ("message", "changes", "complaint"),
    [
        ("lost", {}, "unknown outcome 'lost'"),
        ("net", {}, "returned is 'true'"),
        ("returned", {"landing_x_m": "far"}, "not readable"),
        ("returned", {"struck": "yes"}, "not readable"),
        ("returned", {"ball_id": None}, "lacks ball_id"),
    ],
)
def test_unreadable_outcomes_are_refused(
    message: str, changes: dict[str, str | None], complaint: str
) -> None:
    values = Outcome(ball_id=1, struck=True, miss_reason=None).to_values()
    values |= {key: value for key, value in changes.items() if value is not None}
    for key in (key for key, value in changes.items() if value is None):
        del values[key]
    with pytest.raises(UserError, match=complaint):
        Outcome.from_values(message, values)


def test_outcomes_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Outcome(ball_id=1, struck=True, miss_reason=None).ball_id = 2  # type: ignore[misc]
