"""Choosing strategies: by the side to which the ball comes, within reach, and not too late."""

from __future__ import annotations

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.table_tennis.ball.ends import turned
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.chooser import StrategyChooser
from sawyer import ROBOT

PERIOD_S = 0.02
PUSHES = [PaperLabel(side, Stroke.PUSH) for side in Side]
FACTS = made_up_policies(PUSHES).facts
FOREHAND, BACKHAND = (StrategyLabel(str(label)) for label in PUSHES)


def chooser_of(chosen: StrategyLabel) -> StrategyChooser:
    chooser = StrategyChooser(ROBOT, FACTS, np.random.default_rng(0))
    chooser.chosen = chosen
    return chooser


def watch(chooser: StrategyChooser, balls: np.ndarray, joints: np.ndarray) -> list[StrategyLabel]:
    """What is named while a ball (T, 3) is seen every tick."""
    named = []
    for index, ball in enumerate(balls):
        chooser.see(20_000_000 * index, joints, ball, 20_000_000 * index)
        named.append(chooser.chosen)
    return named


def path_of(side: Side, rows: int) -> np.ndarray:
    return ball_path(Feeder().nominal(side).state(), PERIOD_S, rows, Scene().constants())[:, :3]


@pytest.mark.parametrize("side", Side)
def test_a_ball_to_the_other_arm_comes_back_to_where_it_goes(side: Side) -> None:
    """Strokes go across the table: there is time to change sides while the ball is still away."""
    wanted, other = (FOREHAND, BACKHAND) if side is Side.FOREHAND else (BACKHAND, FOREHAND)
    named = watch(chooser_of(other), turned(path_of(side, 20)), FACTS[other].ready_pose)
    assert named[0] == other
    assert named[3:] == [wanted] * 17


def test_an_arm_that_would_come_too_late_stays() -> None:
    named = watch(chooser_of(BACKHAND), path_of(Side.FOREHAND, 40), FACTS[BACKHAND].ready_pose)
    assert set(named) == {BACKHAND}


def test_an_arm_that_is_there_already_changes_at_the_last_moment() -> None:
    named = watch(chooser_of(BACKHAND), path_of(Side.FOREHAND, 10), FACTS[FOREHAND].ready_pose)
    assert named[-1] == FOREHAND


def test_a_ball_out_of_reach_or_down_the_middle_changes_nothing() -> None:
    away = path_of(Side.FOREHAND, 15)
    wide = away + np.array([0.0, -1.6, 0.0])
    joints = FACTS[FOREHAND].ready_pose
    assert set(watch(chooser_of(BACKHAND), wide, joints)) == {BACKHAND}
    middle = away * [1.0, 0.0, 1.0]
    assert set(watch(chooser_of(BACKHAND), middle, joints)) == {BACKHAND}


def test_the_first_strategy_of_a_rally_is_drawn_once_the_ball_lies_still() -> None:
    chooser = chooser_of(FOREHAND)
    joints = FACTS[FOREHAND].ready_pose
    drawn = set()
    for rally in range(20):
        ticks = 100 * rally
        for index in range(60):
            ball = np.array([1.5 - 0.08 * min(index, 10), 0.0, 1.0])
            stamp_ns = 20_000_000 * (ticks + index)
            chooser.see(stamp_ns, joints, ball, stamp_ns)
        drawn.add(chooser.chosen)
        before = chooser.chosen
        stamp_ns = 20_000_000 * (ticks + 61)
        assert not chooser.see(stamp_ns, joints, ball, stamp_ns)
        assert chooser.chosen == before
    assert drawn == {FOREHAND, BACKHAND}
