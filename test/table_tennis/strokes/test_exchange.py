"""What is played next: policies, strategy and target, taken up between strokes only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from made_up_policies import made_up_policies
from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.exchange import PolicyExchange
from msrd_ros.table_tennis.strokes.player import Phase, StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.reach import Reach
from sawyer import ROBOT

RESTING, FLYING = np.array([1.5, 0.0, 1.06]), np.array([1.4, 0.0, 1.06])
REACH = replace(Reach.grid([0.4, 0.8], [-0.2, 0.2]), hits=np.array([[True, True], [True, False]]))
INSIDE, OUTSIDE = np.array([0.4, 0.2]), np.array([0.8, 0.2])
LABEL = ALL_LABELS[0]


class Arm:
    """A player and its exchange, ticked in step."""

    def __init__(self, policies: StrokePolicies) -> None:
        self.exchange = PolicyExchange(0, 0.0)
        self.exchange.arriving, self.exchange.wanted = policies, LABEL
        self.player = StrokePlayer(ROBOT, policies.facts[LABEL].ready_pose)
        self.time_ns = 0

    def tick(self, ball: np.ndarray = RESTING) -> np.ndarray:
        self.exchange.prepare(self.player, self.exchange.swap(self.player))
        self.time_ns += round(CONTROL_PERIOD_S * 1e9)
        return self.player.tick(self.player.reference.position, ball, self.time_ns).velocity

    def stroke(self, target: np.ndarray | None) -> np.ndarray:
        """What the first steps of a stroke do that a target was wanted for."""
        for _ in range(5):
            self.tick()
        self.exchange.aim(target)
        return np.array([self.tick(FLYING - [0.1 * step, 0.0, 0.0]) for step in range(5)])


def aimable() -> StrokePolicies:
    return made_up_policies(ALL_LABELS[:2], reach=REACH)


def test_a_target_counts_that_comes_with_the_ball() -> None:
    arm = Arm(aimable())
    told = arm.stroke(INSIDE)
    assert arm.player.phase is Phase.STROKE
    np.testing.assert_array_equal(arm.exchange.target, INSIDE)
    assert not np.allclose(told, Arm(aimable()).stroke(None))


def test_one_that_comes_in_mid_stroke_waits_for_the_next() -> None:
    arm = Arm(aimable())
    before = arm.stroke(None)
    arm.exchange.aim(INSIDE)
    arm.tick(FLYING - [0.6, 0.0, 0.0])
    assert arm.exchange.target is None
    for _ in range(400):
        arm.tick()
    np.testing.assert_array_equal(arm.exchange.target, INSIDE)
    assert not np.allclose(arm.stroke(INSIDE), before)


def test_a_target_out_of_reach_is_as_none_and_says_why() -> None:
    arm = Arm(aimable())
    told = arm.stroke(OUTSIDE)
    assert arm.exchange.target is None
    assert (
        "out of reach of forehand-push; the nearest that is in reach is x 0.600, y 0.200 m"
        in arm.exchange.refusal
    )
    np.testing.assert_array_equal(told, Arm(aimable()).stroke(None))
    arm.exchange.aim(None)
    assert not arm.exchange.refusal


def test_another_strategy_looks_at_the_target_anew() -> None:
    policies = aimable()
    other = replace(policies.facts[ALL_LABELS[1]], reach=replace(REACH, hits=np.ones((2, 2), dtype=np.bool_)))
    arm = Arm(replace(policies, facts={**policies.facts, ALL_LABELS[1]: other}))
    arm.exchange.aim(OUTSIDE)
    arm.tick()
    assert arm.exchange.refusal
    arm.exchange.wanted = ALL_LABELS[1]
    arm.tick()
    assert (arm.exchange.target is OUTSIDE, arm.exchange.refusal) == (True, "")


def test_policies_that_take_no_target_play_on_and_say_so() -> None:
    arm = Arm(made_up_policies(ALL_LABELS[:2]))
    told = arm.stroke(INSIDE)
    assert "takes no target" in arm.exchange.refusal
    np.testing.assert_array_equal(told, Arm(made_up_policies(ALL_LABELS[:2])).stroke(None))
