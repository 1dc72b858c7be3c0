"""The feeder's balls at the robot, and their spread."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.ball.feeder import EASY, NO_SPREAD, STANDARD, Feed, Feeder, FeedSpread
from msrd_ros.table_tennis.ball.referee import MISSED, new_referees
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import FLOOR, NO_PADDLE, TABLE
from msrd_ros.table_tennis.strategies.table import Side

CONSTANTS = Scene().constants()


def fly_feed(state: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """States (N, 9) each millisecond, the referee, and the surfaces touched in order."""
    ball, referee = state.copy(), new_referees(1)
    states, touches = [ball.copy()], []
    for index in range(round(duration * 1000)):
        touched = step_ball(ball, referee, NO_PADDLE, NO_PADDLE, index * 0.001, 0.001, CONSTANTS)
        states.append(ball.copy())
        if touched:
            touches.append(touched)
    return np.array(states), referee, touches


@pytest.mark.parametrize(("side", "sign"), [(Side.FOREHAND, -1.0), (Side.BACKHAND, 1.0)])
def test_the_nominal_feed_arrives_as_computed_beforehand(side: Side, sign: float) -> None:
    states, _, touches = fly_feed(Feeder().nominal(side).state(), 0.94)
    assert touches == [TABLE]
    at_hit = states[-1]
    np.testing.assert_allclose(at_hit[:3], (-1.58, sign * 0.35, 1.06), atol=0.01)
    np.testing.assert_allclose(at_hit[3:6], (-1.90, sign * 0.22, -0.94), atol=0.02)
    assert at_hit[7] == pytest.approx(-37.7, abs=1.5)
    over_net = states[np.argmax(states[:, 0] <= 0.0)]
    assert over_net[2] == pytest.approx(1.26, abs=0.01)
    bounce = states[np.argmax(np.diff(states[:, 5]) > 1.0)]
    assert bounce[0] == pytest.approx(-0.897, abs=0.01)


def test_a_feed_without_spin_gains_topspin_at_the_bounce() -> None:
    states, _, _ = fly_feed(Feeder(backspin_rad_s=0.0).nominal(Side.FOREHAND).state(), 0.9)
    assert states[-1, 7] == pytest.approx(-100.0, abs=5.0)


def test_sides_are_mirror_images() -> None:
    mirror = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1])
    forehand, backhand = (Feeder().nominal(side).state() for side in (Side.FOREHAND, Side.BACKHAND))
    np.testing.assert_allclose(forehand, backhand * mirror)


def test_the_same_seed_gives_the_same_feeds_one_by_one_or_together() -> None:
    many = Feeder().sample_states(Side.BACKHAND, STANDARD, 5, np.random.default_rng(3))
    rng = np.random.default_rng(3)
    single = [Feeder().sample(Side.BACKHAND, STANDARD, rng) for _ in range(5)]
    np.testing.assert_array_equal(many, [feed.state() for feed in single])
    assert Feed.from_state(many[2]) == single[2]


def test_spread_fills_its_range_and_no_spread_is_the_nominal_feed() -> None:
    feeder = Feeder()
    states = feeder.sample_states(Side.FOREHAND, STANDARD, 4000, np.random.default_rng(4))
    speed = np.linalg.norm(states[:, 3:6], axis=1)
    elevation = np.degrees(np.arcsin(states[:, 5] / speed))
    yaw = np.degrees(np.arctan2(-states[:, 4], -states[:, 3]))
    spin = np.linalg.norm(states[:, 6:9], axis=1)
    for values, middle, half in (
        (speed, 5.42, 0.03 * 5.42),
        (elevation, 23.9, 1.5),
        (yaw, 6.5, 1.5),
        (spin, 60.0, 20.0),
        (states[:, 1], 0.0, 0.02),
    ):
        offset = np.abs(values - middle).max()
        assert 0.98 * half < offset <= half + 1e-9
        assert np.mean(values) == pytest.approx(middle, abs=0.05 * half)
    exact = feeder.sample_states(Side.FOREHAND, NO_SPREAD, 3, np.random.default_rng(5))
    np.testing.assert_array_equal(exact, np.tile(feeder.nominal(Side.FOREHAND).state(), (3, 1)))


def test_easy_is_half_of_standard() -> None:
    assert FeedSpread(**{name: 2 * value for name, value in vars(EASY).items()}) == STANDARD


@pytest.mark.parametrize("side", list(Side))
def test_every_standard_feed_is_playable(side: Side) -> None:
    """One bounce on the robot's half, over its end line, then the floor."""
    for state in Feeder().sample_states(side, STANDARD, 100, np.random.default_rng(6)):
        states, referee, touches = fly_feed(state, 1.5)
        assert touches[:2] == [TABLE, FLOOR]
        assert referee[0]["verdict"] == MISSED
        passing = states[np.argmax(states[:, 0] < -1.37)]
        assert 0.95 < passing[2] < 1.25
