"""Batched play with targets does what single policies do."""

from __future__ import annotations

import numpy as np

from made_up_policies import made_up_policies
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.batched_play import batch_policy, play_batch
from msrd_ros.table_tennis.strokes.policies import StrokeDraws
from msrd_ros.table_tennis.strokes.reach import Reach
from sawyer import JOINT_COUNT

POLICIES = made_up_policies(ALL_LABELS[:2], reach=Reach.grid([0.4, 0.8], [-0.2, 0.2]))
TARGETS = np.array([[(0.4, 0.1), (0.8, -0.2), (1.0, 0.3)]] * 2)


def test_actions_are_those_of_single_policies() -> None:
    seen = np.random.default_rng(0).normal(size=(2, 3, 13))
    together = batch_policy(POLICIES, TARGETS)(seen)
    for row, label in enumerate(POLICIES.labels):
        for column in range(3):
            alone = POLICIES.play(label, StrokeDraws.of(0, 0, JOINT_COUNT), TARGETS[row, column])
            np.testing.assert_allclose(together[row, column], alone(seen[row, column]), atol=1e-5)


def test_policies_that_take_none_do_not_look_at_targets() -> None:
    policies, seen = made_up_policies(ALL_LABELS[:2]), np.zeros((2, 3, 13))
    np.testing.assert_array_equal(
        batch_policy(policies, TARGETS)(seen), batch_policy(policies, -TARGETS)(seen)
    )


def test_what_is_seen_follows_the_targets() -> None:
    def play(targets: np.ndarray) -> np.ndarray:
        return play_batch(POLICIES, targets, RallyVariation(), np.random.default_rng(1))[1]

    np.testing.assert_array_equal(play(TARGETS), play(TARGETS))
    other = TARGETS.copy()
    other[0, 1] = 0.5, 0.5
    differs = (play(other) != play(TARGETS)).any(axis=(2, 3))
    np.testing.assert_array_equal(differs, [[False, True, False], [False, False, False]])
