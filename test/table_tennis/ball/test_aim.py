"""Feeds that come down where they are told, over the net."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.aim import aimed_feed
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.table import Side

PERIOD_S = 0.001


def bounce_and_net(feed: object, scene: Scene) -> tuple[np.ndarray, float]:
    """Where a feed first bounces, and its height over the net's edge as it crosses."""
    path = ball_path(feed.state(), PERIOD_S, 1600, scene.constants())  # type: ignore[attr-defined]
    up = int(np.flatnonzero((path[1:, 5] > 0) & (path[:-1, 5] < 0))[0])
    crossing = int(np.argmax(path[:, 0] < 0))
    edge = scene.table.height_m + scene.net.height_m + scene.ball.radius_m
    return path[up, :2], float(path[crossing, 2] - edge)


@given(st.floats(-1.25, -0.2), st.floats(-0.65, 0.65), st.floats(4.5, 8.0), st.floats(-150.0, 150.0))
def test_it_comes_down_there_or_says_that_it_cannot(x: float, y: float, speed: float, spin: float) -> None:
    try:
        feed = aimed_feed((x, y), speed, spin)
    except UserError:
        event("cannot be")
        return
    bounce, over_net = bounce_and_net(feed, Scene())
    np.testing.assert_allclose(bounce, (x, y), atol=0.02)
    assert over_net > -0.005
    assert np.linalg.norm(feed.velocity) == pytest.approx(speed)
    assert np.linalg.norm(feed.spin) == pytest.approx(abs(spin))


def test_the_feeders_own_ball_can_be_aimed() -> None:
    nominal = Feeder().nominal(Side.FOREHAND)
    place, _ = bounce_and_net(nominal, Scene())
    aimed = aimed_feed((float(place[0]), float(place[1])), 5.42, 60.0)
    np.testing.assert_allclose(np.linalg.norm(aimed.velocity), np.linalg.norm(nominal.velocity))
    np.testing.assert_allclose(aimed.spin, nominal.spin, atol=1.0)


@pytest.mark.parametrize(("place", "speed"), [((-1.2, 0.5), 3.0), ((-0.1, 0.0), 9.0)])
def test_what_cannot_be_is_refused(place: tuple[float, float], speed: float) -> None:
    with pytest.raises(UserError, match="cannot pass the net and come down"):
        aimed_feed(place, speed, 0.0)
