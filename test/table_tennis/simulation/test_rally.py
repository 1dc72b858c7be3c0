"""The rally in Bullet: strokes return balls, and the same ball repeats bit for bit."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest

from msrd_ros.contract.outcome import MissReason
from msrd_ros.core.errors import UserError
from msrd_ros.robots.limits import JointReference, shape_command
from msrd_ros.robots.quintic import JointStroke
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feed, Feeder
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import ROBOT

pytestmark = pytest.mark.slow

PERIOD_S = 0.02
READY = np.array([0.0, 0.3, -1.2, 0.5, -0.5, 1.5, 0.0])


@pytest.fixture
def rally() -> Iterator[Rally]:
    with Rally() as one:
        yield one


@pytest.fixture(scope="module")
def strokes() -> dict[PaperLabel, JointStroke]:
    return planned_strokes()


def _play(rally: Rally, stroke: JointStroke, feed: Feed) -> None:
    """Play a planned stroke with one command per control period."""
    rally.reset(stroke.start.position)
    rally.launch(feed)
    while rally.ball_in_play:
        wanted = stroke.at(rally.ball_time + PERIOD_S)
        rally.command(wanted.position, wanted.velocity, PERIOD_S)
        rally.advance(PERIOD_S)


def _record(rally: Rally, seed: int, chunk_s: float = PERIOD_S) -> np.ndarray:
    """Launch a ball from where the arm is, wave the arm about, and write everything down."""
    rng = np.random.default_rng(seed)
    rally.launch(Feeder().sample(Side.FOREHAND, STANDARD, rng))
    reference, wish, rows = JointReference(READY, np.zeros(7)), np.zeros(7), []
    for step in range(60):
        if step % 5 == 0:
            wish = rng.normal(size=7) * 1.5
        reference = shape_command(ROBOT, reference, wish, PERIOD_S)
        rally.command(*reference, PERIOD_S)
        for _ in range(round(PERIOD_S / chunk_s)):
            rally.advance(chunk_s)
        rows.append(
            np.concatenate([rally.joint_position, rally.joint_velocity, rally.joint_effort, rally.ball])
        )
    return np.array(rows)


def _return_to_ready(rally: Rally) -> None:
    reference = rally.reference
    for _ in range(200):
        rally.command(READY, np.zeros(7), 1.0)
        rally.advance(PERIOD_S)
    rally.command(READY, np.zeros(7), 1.0)
    rally.advance(1.5)
    assert rally.at_rest
    assert np.abs(reference.position - READY).max() > 0.01


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_planned_strokes_return_the_ball_with_their_spin_within_limits(
    rally: Rally, strokes: dict[PaperLabel, JointStroke], label: PaperLabel
) -> None:
    _play(rally, strokes[label], Feeder().nominal(label.side))
    outcome = rally.outcome
    assert outcome is not None
    assert outcome.returned, outcome.message
    assert outcome.hit_time_s == pytest.approx(strokes[label].hit_time_s, abs=0.02)
    spin = outcome.spin_y_rad_s
    if label.stroke is Stroke.PUSH:
        assert abs(spin) < 40.0
    else:
        assert (spin > 60.0) if label.stroke is Stroke.TOPSPIN else (spin < -60.0)
    assert rally.limits.limits_exceeded == 0
    assert rally.limits.speed_fraction.max() < 1.0


def test_the_paddle_is_where_the_stroke_wants_it_at_the_hit(
    rally: Rally, strokes: dict[PaperLabel, JointStroke]
) -> None:
    stroke = strokes[ALL_LABELS[2]]
    rally.reset(stroke.start.position)
    for step in range(1, round(stroke.hit_time_s / PERIOD_S) + 1):
        wanted = stroke.at(step * PERIOD_S)
        rally.command(wanted.position, wanted.velocity, PERIOD_S)
        rally.advance(PERIOD_S)
    # Commands every 20 ms, cubics in between: a tenth of a milliradian off the stroke itself.
    np.testing.assert_allclose(rally.joint_position, wanted.position, atol=1e-4)
    np.testing.assert_allclose(rally.joint_velocity, wanted.velocity, atol=0.02)


def test_a_ball_that_nobody_plays_is_missed(rally: Rally) -> None:
    rally.reset(READY)
    rally.launch(Feeder().nominal(Side.BACKHAND))
    times = []
    while rally.ball_in_play:
        assert rally.outcome is None
        rally.advance(PERIOD_S, lambda time, ball: times.append((time, ball[0])))
    assert rally.outcome is not None
    assert rally.outcome.miss_reason is MissReason.MISSED
    assert not rally.outcome.struck
    assert np.isnan(rally.outcome.landing_x_m)
    assert rally.ball_time >= RallyConfig().shortest_s
    np.testing.assert_allclose([time for time, _ in times], np.arange(1, len(times) + 1) * 0.001)
    assert times[-1][1] < -1.5 < times[0][1]


def test_a_fresh_and_a_used_rally_repeat_bit_for_bit(
    rally: Rally, strokes: dict[PaperLabel, JointStroke]
) -> None:
    rally.reset(READY)
    fresh = _record(rally, 5)
    for label in ALL_LABELS[1:3]:
        _play(rally, strokes[label], Feeder().nominal(label.side))
    rally.reset(READY)
    np.testing.assert_array_equal(_record(rally, 5), fresh)
    with Rally() as other:
        other.reset(READY)
        np.testing.assert_array_equal(_record(other, 5), fresh)


def test_an_arm_that_came_to_rest_by_itself_repeats_bit_for_bit(rally: Rally) -> None:
    rally.reset(READY)
    first = _record(rally, 6)
    _return_to_ready(rally)
    np.testing.assert_array_equal(_record(rally, 6), first)


def test_the_length_of_the_ticks_does_not_matter(rally: Rally) -> None:
    rally.reset(READY)
    coarse = _record(rally, 7)
    for chunk_s in (0.004, 0.001):
        rally.reset(READY)
        np.testing.assert_array_equal(_record(rally, 7, chunk_s), coarse)


def test_telling_a_resting_arm_to_stay_does_not_wake_it(rally: Rally) -> None:
    rally.reset(READY)
    for _ in range(5):
        rally.command(READY, np.zeros(7), PERIOD_S)
        assert rally.at_rest
        rally.advance(PERIOD_S)
    np.testing.assert_array_equal(rally.joint_position, READY)


def test_play_out_ends_the_rally(rally: Rally) -> None:
    rally.launch(Feeder().nominal(Side.FOREHAND))
    assert rally.play_out() == rally.outcome
    with pytest.raises(ValueError, match="launch"):
        rally.play_out()


def test_a_new_ball_takes_the_place_of_the_old_one(rally: Rally) -> None:
    assert rally.launch(Feeder().nominal(Side.FOREHAND)) == 0
    rally.advance(0.5)
    assert rally.launch(Feeder().nominal(Side.FOREHAND)) == 1
    assert rally.ball_time == 0.0
    assert rally.play_out().ball_id == 1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have no X server to miss")
def test_a_window_without_a_display_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(UserError, match="gui:=false"):
        Rally(gui=True)


def test_bad_input_is_refused_by_name(rally: Rally) -> None:
    beyond = READY.copy()
    beyond[1] = 2.5
    with pytest.raises(UserError, match="right_j1"):
        rally.reset(beyond)
    beyond[1] = np.nan
    with pytest.raises(UserError, match="right_j1"):
        rally.reset(beyond)
    with pytest.raises(UserError, match="feed"):
        rally.launch(Feed((np.nan, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="steps"):
        rally.advance(0.0005)
