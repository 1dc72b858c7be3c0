"""A strategy that no file lists, through all nodes: said, recorded, played and reported by its own name."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from made_up_policies import made_up_policies, with_columns
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from stack import Stack

pytestmark = pytest.mark.processes

SMASH = StrategyLabel.parse("my-smash")


def test_an_unlisted_strategy_is_recorded_played_and_reported(stack: Stack, tmp_path: Path) -> None:
    policies = made_up_policies(ALL_LABELS[3:4])
    renamed = replace(
        with_columns(policies, labels=(str(SMASH),)), facts={SMASH: policies.facts[ALL_LABELS[3]]}
    )
    checkpoint, report, bags = tmp_path / "policies.safetensors", tmp_path / "report.json", tmp_path / "bags"
    checkpoint.write_bytes(renamed.to_bytes())
    stack.start_simulator(seed=2)
    recorder = stack.start("recorder", directory=bags, keep="all")
    recorder.wait_for_line("ready: recording")
    stack.start("executor", checkpoint=checkpoint).wait_for_line("ready: lockstep")

    evaluator = stack.start("evaluator", balls=1, checkpoint=checkpoint, report=report)
    assert evaluator.wait(90.0) == 0, evaluator.output
    evaluator.wait_for_line(f"^{SMASH} .* -$")
    (row,) = json.loads(report.read_text())["labels"].values()
    assert (row["fed"], row["spin_class_right"]) == (1, None)

    recorder.wait_for_line(f"kept.*: {SMASH} of s01")
    path = bags / "s01" / f"{SMASH}_001"
    stack.wait_until(path.is_dir, "bag")
    (episode,) = read_episodes(Bag(path))
    assert episode.label == SMASH
    # Its checkpoint says backhand: that is where the ball was fed.
    assert episode.ball_position[20, 1] > 0.0
