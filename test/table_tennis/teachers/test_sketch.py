"""A sketch says what it means, refuses what means nothing, and has variations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import path_at
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, feed_path
from msrd_ros.table_tennis.teachers.sketch import Ghost, Moment, Sketch, variation

LEVEL = (0.0, 0.0, 0.0, 1.0)
SKETCH = Sketch(
    StrategyLabel("my-smash"),
    Side.FOREHAND,
    Feeder().nominal(Side.FOREHAND),
    Ghost((-1.8, -0.3, 1.0), LEVEL),
    Ghost((-1.5, -0.3, 1.0), LEVEL),
    Ghost((-1.3, -0.3, 1.1), LEVEL),
    contact_s=0.94,
    swing_s=0.4,
    follow_s=0.3,
)


@pytest.mark.parametrize(
    ("changes", "blame"),
    [
        ({"strategy": "My Smash"}, "strategy"),
        ({"contact_s": 0.0}, "contact_s"),
        ({"contact_s": 9.0}, "contact_s"),
        ({"contact_s": float("nan")}, "contact_s"),
        ({"swing_s": 0.0}, "swing_s"),
        ({"swing_s": 1.1}, "launch"),
        ({"follow_s": float("inf")}, "follow_s"),
    ],
)
def test_what_means_nothing_is_refused_by_name(changes: dict[str, Any], blame: str) -> None:
    with pytest.raises(UserError, match=blame):
        replace(SKETCH, **changes)


def test_a_ghost_is_somewhere() -> None:
    with pytest.raises(UserError, match="finite"):
        Ghost((float("nan"), 0.0, 1.0), LEVEL)
    with pytest.raises(UserError, match="zero"):
        Ghost((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))


def test_a_ghost_is_what_it_was_made_of() -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    ghost = Ghost.of(np.array([1.0, 2.0, 3.0]), quarter)
    np.testing.assert_allclose(ghost.rotation, quarter, atol=1e-12)
    np.testing.assert_allclose(ghost.moved(np.array([0.0, 0.0, 1.0])).position, [1.0, 2.0, 4.0])


def test_ghosts_come_in_the_order_of_time() -> None:
    assert list(SKETCH.ghosts) == list(Moment)
    assert SKETCH.ghosts[Moment.CONTACT] == SKETCH.contact


def test_variations_differ_as_much_as_was_said_and_keep_their_shape() -> None:
    rng = np.random.default_rng(0)
    some = [variation(SKETCH, rng, timing_s=0.01, tempo=0.05) for _ in range(400)]
    late = np.array([each.contact_s for each in some]) - SKETCH.contact_s
    swings = np.array([each.swing_s for each in some]) / 0.4
    assert np.abs(late).max() <= 0.02 + 1e-12
    assert late.std() == pytest.approx(0.0095, rel=0.2)
    assert swings.std() == pytest.approx(0.0475, rel=0.2)
    path = feed_path(SKETCH.feed, Scene().constants())
    for each in some[:20]:
        way = each.contact.position - SKETCH.contact.position
        flown = path_at(path, PATH_PERIOD_S, each.contact_s) - path_at(path, PATH_PERIOD_S, SKETCH.contact_s)
        np.testing.assert_allclose(way, flown[:3], atol=1e-12)
        for moment, ghost in each.ghosts.items():
            np.testing.assert_allclose(ghost.position - SKETCH.ghosts[moment].position, way, atol=1e-12)
            assert ghost.quaternion == SKETCH.ghosts[moment].quaternion


def test_a_variation_repeats_from_its_seed_and_without_spread_changes_nothing() -> None:
    assert variation(SKETCH, np.random.default_rng(1)) == variation(SKETCH, np.random.default_rng(1))
    assert variation(SKETCH, np.random.default_rng(1)) != variation(SKETCH, np.random.default_rng(2))
    assert variation(SKETCH, np.random.default_rng(1), timing_s=0.0, tempo=0.0) == SKETCH
    with pytest.raises(UserError, match="timing_s"):
        variation(SKETCH, np.random.default_rng(1), timing_s=-0.01)


def test_durations_left_to_the_arm_stay_so() -> None:
    free = replace(SKETCH, swing_s=None, follow_s=None)
    varied = variation(free, np.random.default_rng(1))
    assert (varied.swing_s, varied.follow_s) == (None, None)
