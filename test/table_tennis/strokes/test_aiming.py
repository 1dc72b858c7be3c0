"""Targets learned from few rollouts: strokes go about where they are told, and stay strokes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import share_directory
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.aiming import AimingConfig, aim
from msrd_ros.table_tennis.strokes.batched_play import land_near, play_batch
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

pytestmark = pytest.mark.slow

LABELS = tuple(map(StrategyLabel, ("forehand-push", "backhand-slice")))
CONFIG = AimingConfig(rollouts=200, cloning_steps=600, reach_balls=10, threads=1)
TARGETS = np.broadcast_to(np.repeat([(0.5, -0.3), (0.5, 0.3), (1.0, 0.0)], 30, axis=0), (2, 90, 2))


def two_strokes() -> StrokePolicies:
    policies = StrokePolicies.load(
        share_directory() / "config" / "robots" / "sawyer" / "policies.safetensors"
    )
    chosen = policies.policies
    for label in policies.labels:
        if label not in LABELS:
            chosen = chosen.without(str(label))
    return replace(policies, policies=chosen, facts={label: policies.facts[label] for label in LABELS})


@cache
def aimed() -> StrokePolicies:
    return StrokePolicies.from_bytes(aim(two_strokes(), CONFIG).to_bytes(), "aimed")


def test_balls_land_at_targets() -> None:
    results, seen = play_batch(aimed(), TARGETS, CONFIG.variation, np.random.default_rng(1))
    assert seen.shape[:2] == (2, 90)
    assert (land_near(results, TARGETS, 0.2).mean(axis=1) > 0.8).all()
    untold, _ = play_batch(two_strokes(), TARGETS, CONFIG.variation, np.random.default_rng(1))
    assert land_near(untold, TARGETS, 0.2).mean() < 0.4


def test_strokes_stay_what_they_were() -> None:
    results, _ = play_batch(aimed(), TARGETS, CONFIG.variation, np.random.default_rng(2))
    for row, label in enumerate(LABELS):
        spins = results.spin[row, results.returned[row], 1]
        right = [bool(Strategies.shipped().spin_is_right(label, spin)) for spin in spins]
        assert np.mean(right) > 0.95, label


def test_a_reach_is_kept_and_holds_the_teachers_mean_point() -> None:
    for label, facts in aimed().facts.items():
        assert facts.reach is not None
        assert facts.reach.hits.mean() > 0.5, label
        facts.require_reach(facts.landing_point, str(label))


def test_the_same_seed_learns_the_same() -> None:
    few = replace(CONFIG, rollouts=20, cloning_steps=5, reach_balls=1)
    assert aim(two_strokes(), few).digest == aim(two_strokes(), few).digest
    assert aim(two_strokes(), few).digest != aim(two_strokes(), replace(few, seed=1)).digest


def test_an_unknown_landing_point_becomes_the_policies_own() -> None:
    policies = two_strokes()
    facts = {
        label: replace(known, landing_point=np.full(2, np.nan)) for label, known in policies.facts.items()
    }
    few = replace(CONFIG, rollouts=40, cloning_steps=5, reach_balls=1)
    found = aim(replace(policies, facts=facts), few).facts
    for label in LABELS:
        assert np.linalg.norm(found[label].landing_point - policies.facts[label].landing_point) < 0.3


def test_policies_that_return_nothing_are_refused() -> None:
    with pytest.raises(UserError, match=r"forehand-push returns .*% of its balls; .* train it longer"):
        aim(made_up_policies(), replace(CONFIG, rollouts=10))
