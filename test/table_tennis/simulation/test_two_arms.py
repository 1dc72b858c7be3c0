"""Two arms and one ball: each stroke is judged as that of an arm alone, and the ball goes from end to end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.outcome import MissReason
from msrd_ros.core.errors import UserError
from msrd_ros.robots.quintic import JointStroke
from msrd_ros.table_tennis.ball.ends import End, between, turned
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.simulation.rally import Rally
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.two_arms import TwoArms, require_apart
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import HOME_POSTURE_RAD, ROBOT

pytestmark = pytest.mark.slow

FEED = Feeder().nominal(Side.FOREHAND)
LONGEST_S = 4.0


@pytest.fixture
def arms() -> Iterator[TwoArms]:
    with TwoArms() as two:
        yield two


def play_out(arms: TwoArms) -> None:
    while arms.in_play:
        arms.advance(CONTROL_PERIOD_S)


def stroke() -> JointStroke:
    return planned_strokes()[PaperLabel(Side.FOREHAND, Stroke.PUSH)]


def swing(arms: TwoArms, end: End, feed: Feed) -> None:
    """Play the planned push open loop at an end against its nominal feed."""
    planned = stroke()
    arms.robots[end].reset(planned.start.position)
    arms.launch(feed, end)
    for step in range(1, 70):
        state = planned.sample(np.array([step * CONTROL_PERIOD_S]))
        arms.robots[end].command(state.position[0], state.velocity[0], CONTROL_PERIOD_S)
        arms.advance(CONTROL_PERIOD_S)


def test_arms_at_both_ends_cannot_reach_each_other() -> None:
    assert require_apart(RallyConfig()) == pytest.approx(1.39, abs=0.01)
    near = replace(ROBOT, shoulder=np.array([-1.2, 0.0, 0.99]))
    with pytest.raises(UserError, match="two of them at one table could reach each other"):
        require_apart(RallyConfig(robot=near))


@pytest.mark.parametrize("end", End)
def test_a_ball_that_nobody_strikes_ends_the_rally_where_it_was_fed(arms: TwoArms, end: End) -> None:
    arms.launch(FEED, end)
    play_out(arms)
    assert arms.record is not None
    assert arms.record.hits == 0
    assert arms.record.end_reason is MissReason.MISSED
    (shot,) = arms.record.shots
    assert shot.end is end
    np.testing.assert_array_equal(shot.incoming, FEED.state())


def test_both_ends_play_alike(arms: TwoArms) -> None:
    outcomes = []
    for end in End:
        swing(arms, end, FEED)
        play_out(arms)
        assert arms.record is not None
        first, second = arms.record.shots
        assert (first.end, second.end) == (end, end.other)
        assert first.outcome.returned
        outcomes.append(first.outcome)
        arms.robots[end].reset(HOME_POSTURE_RAD)
    near, far = outcomes
    assert far.hit_time_s == pytest.approx(near.hit_time_s, abs=1e-9)
    assert far.landing_x_m == pytest.approx(near.landing_x_m, abs=1e-9)
    assert far.spin_y_rad_s == pytest.approx(near.spin_y_rad_s, abs=1e-6)


def test_a_first_stroke_is_that_of_an_arm_alone(arms: TwoArms) -> None:
    swing(arms, End.NEAR, FEED)
    planned = stroke()
    with Rally() as alone:
        alone.reset(planned.start.position)
        alone.launch(FEED)
        for step in range(1, 70):
            state = planned.sample(np.array([step * CONTROL_PERIOD_S]))
            alone.command(state.position[0], state.velocity[0], CONTROL_PERIOD_S)
            alone.advance(CONTROL_PERIOD_S)
        outcome = alone.play_out()
        np.testing.assert_array_equal(arms.robots[End.NEAR].joint_position, alone.joint_position)
    play_out(arms)
    assert arms.record is not None
    first = arms.record.shots[0].outcome
    for name in ("hit_time_s", "landing_x_m", "landing_y_m", "spin_y_rad_s", "velocity_x_m_s"):
        assert getattr(first, name) == getattr(outcome, name), name


def test_a_struck_ball_sets_out_to_the_other_arm_at_the_hit(arms: TwoArms) -> None:
    swing(arms, End.NEAR, FEED)
    play_out(arms)
    assert arms.record is not None
    struck, answered = arms.record.shots
    assert struck.outcome.struck
    velocity = [struck.outcome.velocity_x_m_s, struck.outcome.velocity_y_m_s, struck.outcome.velocity_z_m_s]
    np.testing.assert_allclose(turned(answered.incoming)[3:6], velocity)
    assert answered.incoming[0] > 1.2
    assert not answered.outcome.struck
    # From the hit until it lies on the floor behind the other end.
    assert 0.9 < answered.outcome.decision_time_s < LONGEST_S


def test_the_ball_is_told_in_one_frame(arms: TwoArms) -> None:
    seen: list[np.ndarray] = []
    arms.launch(FEED, End.FAR)
    arms.advance(0.1, lambda _, ball: seen.append(ball.copy()))
    np.testing.assert_array_equal(seen[-1], arms.ball[:3])
    assert seen[0][0] == pytest.approx(-FEED.position[0], abs=0.01)
    np.testing.assert_array_equal(between(End.FAR, arms.ball)[:3], turned(arms.ball)[:3])


def test_a_rally_may_be_cut_off() -> None:
    with TwoArms(most_hits=1) as arms:
        swing(arms, End.NEAR, FEED)
        play_out(arms)
        assert arms.record is not None
        assert arms.record.hits == len(arms.record.shots) == 1
        assert arms.record.end_reason is MissReason.UNDECIDED


def test_a_feed_that_is_not_finite_is_refused(arms: TwoArms) -> None:
    with pytest.raises(UserError, match="not finite"):
        arms.launch(Feed((1.5, 0.0, np.nan), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), End.NEAR)
