"""Arms that nobody taught, what a referee pays, and the study in its quick version."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.checkpoints import import_policies
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.robots.loading import load_robot
from msrd_ros.studies.rewards.arms import arm, slower
from msrd_ros.studies.rewards.report import percent, spin_right
from msrd_ros.studies.rewards.study import ROWS
from msrd_ros.studies.rewards.true_reward import PAID, Referee, right_spins
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.strokes.batched_play import make_simulator
from msrd_ros.table_tennis.strokes.policies import rally_policies
from quick_studies import play

SAWYER = load_robot("sawyer")


def test_a_slower_arm_differs_in_its_speeds_alone(tmp_path: Path) -> None:
    found = arm("sawyer_60_percent", tmp_path)
    np.testing.assert_allclose(found.limits.speed_rad_s, 0.6 * SAWYER.limits.speed_rad_s, atol=1e-5)
    np.testing.assert_array_equal(found.limits.acceleration_rad_s2, SAWYER.limits.acceleration_rad_s2)
    np.testing.assert_array_equal(found.home_rad, SAWYER.home_rad)
    assert found != SAWYER
    assert found.name == "sawyer_60_percent"
    assert arm("ur10e", tmp_path) == load_robot("ur10e")
    with pytest.raises(UserError, match="120 % of its speed: give 1 to 100"):
        slower(SAWYER, 120, tmp_path)
    with pytest.raises(UserError, match="robot 'hand': is none of"):
        arm("hand", tmp_path)


def test_a_referee_pays_at_the_end_for_returns_with_the_right_spin() -> None:
    policies = rally_policies(SAWYER)
    simulator = make_simulator(policies, RallyVariation(), 1)
    collector = Referee(simulator, policies.labels)
    network = import_policies(policies.policies)
    played = collector.collect(network, 6, np.random.default_rng(0), deterministic=True)
    results = simulator.results()
    assert results.returned.any()
    right = right_spins(policies.labels, results)
    assert right.any()
    paid = played.environment_reward
    assert paid is not None
    assert (paid[..., :-1] == 0.0).all()
    np.testing.assert_array_equal(paid[..., -1], PAID * right)
    other = tuple(StrategyLabel(str(label).replace("push", "topspin")) for label in policies.labels)
    assert not right_spins(other, results).any()
    unpaid = BatchedCollector(simulator).collect(network, 2, np.random.default_rng(0), deterministic=True)
    assert unpaid.environment_reward is None


def test_spin_counts_by_returned_balls() -> None:
    assert spin_right({"returned": [1.0, 0.5], "spin_right": [1.0, 0.4]}) == pytest.approx(1.2 / 1.5)
    assert np.isnan(spin_right({"returned": [0.0], "spin_right": [0.0]}))
    assert percent([0.5, 1.0]) == "75.0 % (50 to 100)"
    assert percent([0.5]) == "50.0 %"


@pytest.mark.slow
def test_quick_study_writes_every_row_and_goes_on_from_what_is_kept(tmp_path: Path) -> None:
    first = play("rewards", tmp_path)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["study"] == "rewards"
    rows = metrics["arms"]["ur10e"]
    assert set(rows) == set(ROWS)
    for results in rows.values():
        assert len(results) == 1
        assert len(results[0]["returned"]) == len(metrics["labels"]) == 6
        assert 0.0 <= min(results[0]["returned"]) <= max(results[0]["returned"]) <= 1.0
    assert np.mean(rows["retargeting"][0]["returned"]) > np.mean(rows["frozen_from_nothing"][0]["returned"])
    assert "retargeted, corrective cloning" in (tmp_path / "report.html").read_text()
    assert play("rewards", tmp_path) < 0.5 * first
    assert json.loads((tmp_path / "metrics.json").read_text())["arms"] == metrics["arms"]
