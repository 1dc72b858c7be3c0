"""What both arms of a match see, and when their balls are launched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.table_tennis.ball.ends import End, turned
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.simulation.two_arm_world import TwoArmWorld
from msrd_ros.table_tennis.simulation.world import WorldConfig
from msrd_ros.table_tennis.strategies.table import Side
from sawyer import HOME_POSTURE_RAD

pytestmark = pytest.mark.slow

PUSH = StrategyLabel("forehand-push")
FEED = Feeder().nominal(Side.FOREHAND)


@pytest.fixture
def world() -> Iterator[TwoArmWorld]:
    one = TwoArmWorld(WorldConfig(seed=7))
    yield one
    one.close()


def hold(world: TwoArmWorld, ends: tuple[End, ...] = tuple(End)) -> None:
    """One control period in which arms rest at home on behalf of the push."""
    world.look()
    for end in ends:
        world.command(end, HOME_POSTURE_RAD, np.zeros(7), CONTROL_PERIOD_S, PUSH)
    world.advance(CONTROL_PERIOD_S)


def test_a_ball_waits_for_both_arms(world: TwoArmWorld) -> None:
    world.strategies = dict.fromkeys(End, PUSH)
    world.feed(FEED, End.FAR)
    for _ in range(5):
        hold(world, (End.FAR,))
    assert not world.arms.in_play
    assert world.feeds_waiting == 1
    hold(world)
    assert world.arms.in_play
    assert world.arms.turn is End.FAR


def test_both_see_one_ball_each_in_its_own_frame(world: TwoArmWorld) -> None:
    world.strategies = dict.fromkeys(End, PUSH)
    world.feed(FEED, End.FAR)
    for _ in range(12):
        hold(world)
    world.look()
    near, far = (world.tick(end) for end in End)
    np.testing.assert_array_equal(turned(near.ball_position), far.ball_position)
    assert near.ball_stamp_ns == far.ball_stamp_ns
    # On its way to the far arm, over the half of the near one, seen with the camera's noise.
    assert 0.0 < far.ball_position[0] < 1.5
    error_m = np.abs(near.ball_position - world.arms.ball[:3])
    assert 0.0 < error_m.max() < 0.15


def test_a_rally_that_is_over_is_told_once(world: TwoArmWorld) -> None:
    world.strategies = dict.fromkeys(End, PUSH)
    world.feed(FEED, End.NEAR)
    for _ in range(150):
        hold(world)
    (record,) = world.results
    assert record.hits == 0
    assert not world.arms.in_play
    world.look()
    np.testing.assert_array_equal(world.tick(End.NEAR).ball_position, FEED.position)
