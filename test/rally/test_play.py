"""Rallies in process: they repeat, and what ends them is told."""

from __future__ import annotations

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.rally.play import PlayedRally, Unstruck, _why_unstruck, play_rallies
from msrd_ros.rally.report import figures, summary
from msrd_ros.table_tennis.ball.ends import End, turned
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side

pytestmark = pytest.mark.slow

POLICIES = made_up_policies([PaperLabel(side, Stroke.PUSH) for side in Side])


@pytest.fixture(scope="module")
def played() -> tuple[list[PlayedRally], int]:
    return play_rallies(POLICIES, 4, seed=5)


def test_a_seed_repeats_rallies_bit_for_bit(played: tuple[list[PlayedRally], int]) -> None:
    again, exceeded = play_rallies(POLICIES, 4, seed=5)
    assert exceeded == played[1] == 0
    for first, second in zip(played[0], again, strict=True):
        assert first.record.hits == second.record.hits
        assert first.end_reason == second.end_reason
        np.testing.assert_array_equal(first.track.ball, second.track.ball)
        np.testing.assert_array_equal(first.track.joints[End.FAR], second.track.joints[End.FAR])


def test_feeds_go_to_either_arm(played: tuple[list[PlayedRally], int]) -> None:
    rallies, _ = played
    assert {rally.fed_to for rally in rallies} == set(End)
    assert all(rally.record.shots[0].end is rally.fed_to for rally in rallies)
    for rally in rallies:
        # The first ball is seen where it is fed from, on the other arm's half.
        first = rally.track.ball[0] if rally.fed_to is End.NEAR else turned(rally.track.ball[0])
        assert first[0] > 1.3


def test_figures_say_how_long_and_why(played: tuple[list[PlayedRally], int]) -> None:
    rallies, _ = played
    metrics = figures(rallies)
    assert metrics["rallies"] == len(rallies) == sum(metrics["ends"].values())
    assert metrics["hits"]["all"] == [rally.record.hits for rally in rallies]
    assert f"median {metrics['hits']['median']:g} hits" in summary(metrics)
    assert sum(metrics["strategies"].values()) >= len(rallies)


def test_why_a_ball_was_not_touched() -> None:
    robot = POLICIES.robot
    coming = np.linspace([0.5, -0.3, 1.1], [-1.7, -0.3, 1.0], 40)
    wide = coming + np.array([0.0, -2.5, 0.0])
    for end, ball, far in ((End.NEAR, coming, wide), (End.FAR, turned(coming), turned(wide))):
        assert _why_unstruck(POLICIES, end, far, True) is Unstruck.OUT_OF_REACH
        assert _why_unstruck(POLICIES, end, ball, True) is Unstruck.SWUNG_PAST
        assert _why_unstruck(POLICIES, end, ball, False) is Unstruck.NOT_READY
    assert robot.reach_m < 2.5
