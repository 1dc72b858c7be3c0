"""Targets for strokes that are measured: one in reach for each ball, and none for a stroke that has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped

from made_up_policies import made_up_policies
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import LATCHED
from msrd_ros.nodes.messages import target_from_message
from msrd_ros.nodes.target_teller import TargetTeller
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.policies import StrokeFacts
from msrd_ros.table_tennis.strokes.reach import Reach
from stack import Stack

AIMED, LOST = ALL_LABELS[:2]
REACH = replace(Reach.grid([0.4, 0.8], [-0.2, 0.2]), hits=np.array([[True, True], [True, False]]))
FACTS = made_up_policies([AIMED, LOST], reach=REACH).facts
NOTHING = replace(FACTS[LOST], reach=replace(REACH, hits=np.zeros((2, 2), dtype=np.bool_)))


def test_targets_are_told_where_any_is_in_reach(stack: Stack) -> None:
    heard: list[PointStamped] = []
    stack.node.create_subscription(PointStamped, "target", heard.append, LATCHED)
    teller = TargetTeller(stack.node, [AIMED, LOST], {AIMED: FACTS[AIMED], LOST: NOTHING}, seed=0)
    teller.tell(AIMED)
    assert not teller.is_heard
    stack.wait_until(lambda: len(heard) == 1, "the target", 10.0)
    told = target_from_message(heard[0])
    assert told is not None
    np.testing.assert_allclose(told, teller.targets[AIMED][0])
    teller.tell(LOST)
    assert teller.is_heard
    stack.wait_until(lambda: len(heard) == 2, "that it is taken back", 10.0)
    assert heard[1].header.frame_id == ""
    assert list(teller.targets) == [AIMED]


def test_a_stroke_that_never_learned_targets_is_refused(stack: Stack) -> None:
    facts: dict[StrategyLabel, StrokeFacts] = {AIMED: replace(FACTS[AIMED], reach=None)}
    with pytest.raises(UserError, match=f"parameter targets: {AIMED} takes no target"):
        TargetTeller(stack.node, [AIMED], facts, seed=0)
