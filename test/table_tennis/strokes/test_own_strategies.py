"""A strategy of one's own name: shipped pushes, renamed as if that had been said, are learned and played."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, STANDARD, Feeder
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.table import Side, Strategies
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.rates import LabelRates
from msrd_ros.table_tennis.strokes.rollouts import Stroke, play_stroke
from msrd_ros.table_tennis.strokes.training import (
    StrokeTraining,
    StrokeTrainingConfig,
    mean_landing_points,
    stroke_facts,
)
from renamed_bags import rename_strokes

SMASH = StrategyLabel.parse("my-smash")
BALLS = 100
CONFIG = StrokeTrainingConfig(iterations=4, episodes=100, threads=1, corrective_cloning=True)
"""Seconds instead of minutes: recovery labels make the start good, so that few iterations are enough."""


@pytest.mark.parametrize(
    ("label", "side"), [("forehand-push", Side.FOREHAND), ("backhand-slice", Side.BACKHAND)]
)
def test_an_unlisted_strategy_is_fed_where_its_demonstrations_met_the_ball(
    label: str, side: Side, tmp_path: Path
) -> None:
    bags = rename_strokes(shipped_bags() / "subject_01", label, tmp_path, SMASH)
    episodes = [episode for bag in bags for episode in read_episodes(Bag(bag))]
    assert stroke_facts(episodes, {}, Strategies.shipped())[SMASH].side is side


@pytest.mark.timeout(600)
@pytest.mark.slow
def test_renamed_pushes_are_learned_and_return_the_ball(tmp_path: Path) -> None:
    bags = rename_strokes(shipped_bags(), "forehand-push", tmp_path / "bags", SMASH)
    episodes = [episode for bag in bags for episode in read_episodes(Bag(bag))]
    assert len(episodes) == 9
    training = StrokeTraining(episodes, mean_landing_points(episodes), CONFIG)
    training.trainer.clone()
    for _ in range(CONFIG.iterations):
        training.trainer.iterate()
    file = tmp_path / "policies.safetensors"
    file.write_bytes(training.policies().to_bytes())

    policies = StrokePolicies.load(file)
    assert policies.labels == (SMASH,)
    facts = policies.require(SMASH)
    assert facts.side is Side.FOREHAND
    rng = np.random.default_rng((EVALUATION_STREAM, 0))
    strokes = [Stroke(SMASH, Feeder().sample(facts.side, STANDARD, rng), number) for number in range(BALLS)]
    world = World(WorldConfig())
    outcomes = [
        play_stroke(world, policies, stroke, stroke.number, CONFIG.ready_noise_rad, 1)[1]
        for stroke in strokes
    ]
    world.close()
    row = LabelRates.of(SMASH, outcomes, facts.landing_point)
    assert row.returned.share >= 0.95, row.miss_reasons
    assert row.spin_class_right is None
