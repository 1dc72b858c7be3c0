"""The simulated table: when balls are launched, what is seen of them, and that a rally repeats exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.outcome import MissReason
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feed, Feeder
from msrd_ros.table_tennis.simulation.seen_ball import EPOCH_NS
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.rollouts import Stroke, play_stroke
from sawyer import HOME_POSTURE_RAD

pytestmark = pytest.mark.slow

FOREHAND, BACKHAND = ALL_LABELS[0], ALL_LABELS[3]
PERIOD_NS = round(CONTROL_PERIOD_S * 1e9)


@pytest.fixture
def world() -> Iterator[World]:
    one = World(WorldConfig(seed=7))
    yield one
    one.close()


def feed(side: Side = Side.FOREHAND, seed: int = 0) -> Feed:
    return Feeder().sample(side, STANDARD, np.random.default_rng(seed))


def hold(world: World, label: object = FOREHAND) -> None:
    """One control period in which the arm stays at home, on behalf of a strategy."""
    world.command(HOME_POSTURE_RAD, np.zeros(7), CONTROL_PERIOD_S, label)  # type: ignore[arg-type]
    world.advance(CONTROL_PERIOD_S)


def test_time_begins_at_one_second_and_goes_in_whole_periods(world: World) -> None:
    times = []
    for _ in range(100):
        times.append(world.tick().time_ns)
        hold(world)
    assert times == [EPOCH_NS + PERIOD_NS * index for index in range(100)]


def test_a_ball_waits_until_the_arm_serves_the_strategy_and_rests(world: World) -> None:
    world.strategy = BACKHAND
    world.feed(feed(Side.BACKHAND))
    for _ in range(5):
        hold(world, FOREHAND)
    assert not world.rally.ball_in_play
    world.command(HOME_POSTURE_RAD + 0.001, np.full(7, 0.1), CONTROL_PERIOD_S, BACKHAND)
    world.advance(CONTROL_PERIOD_S)
    assert not world.rally.ball_in_play
    ticks = 0
    while not world.rally.ball_in_play:
        hold(world, BACKHAND)
        ticks += 1
        assert ticks < 200
    assert world.tick().label == BACKHAND
    assert world.feeds_waiting == 0


def test_a_ball_is_shown_for_a_tick_where_it_will_be_launched_and_not_before_its_time(world: World) -> None:
    ball = feed(seed=5)
    world.strategy = FOREHAND
    world.feed(ball, EPOCH_NS + 10 * PERIOD_NS)
    hold(world)
    assert world.tick().ball_position.tolist() == list(ball.position)
    while not world.rally.ball_in_play:
        launch_ns = world.tick().time_ns
        hold(world)
    assert launch_ns == EPOCH_NS + 10 * PERIOD_NS


def test_what_the_camera_sees_has_noise_rate_and_latency() -> None:
    config = CameraConfig(rate_hz=30.0, noise_std_m=0.002, latency_s=0.04)
    world = World(WorldConfig(camera=config))
    world.strategy = FOREHAND
    world.feed(feed())
    while not world.rally.ball_in_play:
        hold(world)
        launch_ns = world.tick().time_ns - PERIOD_NS
    ages, errors = [], []
    truth = {}
    for _ in range(50):
        tick = world.tick()
        truth[tick.time_ns] = world.rally.ball[:3]
        frame = (tick.ball_stamp_ns - launch_ns) * 30.0 / 1e9
        assert frame == pytest.approx(round(frame), abs=1e-6)
        ages.append((tick.time_ns - tick.ball_stamp_ns) / 1e9)
        if tick.ball_stamp_ns in truth:
            errors.append(tick.ball_position - truth[tick.ball_stamp_ns])
        hold(world)
    world.close()
    assert min(ages[5:]) >= 0.04
    assert max(ages) < 0.04 + 1 / 30.0
    assert 0.0 < np.abs(errors).max() < 0.012


def test_outcomes_come_once_per_ball_with_the_strategy_of_the_launch(world: World) -> None:
    world.strategy = FOREHAND
    for number in range(2):
        world.feed(feed(seed=number))
    results = []
    for _ in range(700):
        hold(world, world.strategy)
        if world.rally.ball_in_play:
            # Asked for during the rally: it is the next ball's strategy.
            world.strategy = BACKHAND
        results += list(world.results)
        world.results.clear()
    assert [result.label for result in results] == [FOREHAND, BACKHAND]
    assert [result.outcome.ball_id for result in results] == [0, 1]
    assert all(result.outcome.miss_reason is MissReason.MISSED for result in results)
    assert world.balls == 2
    assert world.tick().label is None


def test_a_reset_calls_the_ball_off_and_brings_the_arm_home(world: World) -> None:
    world.strategy = FOREHAND
    for number in range(2):
        world.feed(feed(seed=number))
    while not world.rally.ball_in_play:
        hold(world)
    world.command(HOME_POSTURE_RAD + 0.005, np.full(7, 0.2), CONTROL_PERIOD_S, FOREHAND)
    world.advance(CONTROL_PERIOD_S)
    world.reset()
    (result,) = world.results
    assert (result.label, result.outcome.miss_reason) == (FOREHAND, MissReason.UNDECIDED)
    np.testing.assert_array_equal(world.rally.joint_position, HOME_POSTURE_RAD)
    assert world.feeds_waiting == 0
    assert not world.rally.ball_in_play


def test_while_teaching_a_ball_comes_at_once(world: World) -> None:
    world.set_teaching(True)
    world.strategy = BACKHAND
    world.feed(feed(Side.BACKHAND))
    for _ in range(3):
        world.advance(0.004)
    assert world.rally.ball_in_play
    assert world.tick().label == BACKHAND


def test_a_stroke_repeats_exactly_whatever_was_played_before_and_differs_with_the_ball() -> None:
    policies = made_up_policies()
    stroke, other = Stroke(FOREHAND, feed(), 3), Stroke(BACKHAND, feed(Side.BACKHAND), 4)
    used, fresh = World(WorldConfig(seed=7)), World(WorldConfig(seed=7))
    play_stroke(used, policies, other, 0, 0.03, 11)
    played = [play_stroke(world, policies, stroke, 5, 0.03, 11) for world in (used, fresh, fresh)]
    for episode, outcome in played[1:]:
        np.testing.assert_array_equal(episode.observations, played[0][0].observations)
        np.testing.assert_array_equal(episode.joint_velocity, played[0][0].joint_velocity)
        assert {**outcome.to_values(), "ball_id": ""} == {**played[0][1].to_values(), "ball_id": ""}
    another_ball, _ = play_stroke(fresh, policies, stroke, 6, 0.03, 11)
    noise = another_ball.ball_position - played[0][0].ball_position
    assert 0.0 < np.abs(noise[1:5]).max() < 0.01
    used.close()
    fresh.close()
