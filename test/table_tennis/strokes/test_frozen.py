"""Rewards that were learned on one arm: kept, read back, and what another arm learns from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from msrd_ros.contract.episode import BALL_NAMES, PADDLE_NAMES, Episode
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.strokes.frozen import (
    REWARDS_FILE,
    Start,
    Taught,
    load_taught,
    save_rewards,
    transfer,
)
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.retargeting import RetargetingConfig
from msrd_ros.table_tennis.strokes.training import StrokeTraining, StrokeTrainingConfig, mean_landing_points
from quick_rewards import shipped_strokes

UR10E = load_robot("ur10e")
TINY = StrokeTrainingConfig(iterations=1, episodes=6, threads=1, cloning_steps=300)
FEW = RetargetingConfig(strokes=3, starts=6)


def shown(*labels: str) -> list[Episode]:
    strokes = [stroke for subject in (1, 2, 3) for stroke in shipped_strokes(subject)]
    return [stroke for stroke in strokes if str(stroke.strategy) in labels]


@pytest.fixture(scope="module")
def training() -> StrokeTraining:
    episodes = shown("forehand-push", "backhand-push")
    run = StrokeTraining(episodes, mean_landing_points(episodes), TINY)
    run.trainer.clone()
    run.trainer.iterate()
    return run


@pytest.fixture(scope="module")
def kept(training: StrokeTraining, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / REWARDS_FILE
    save_rewards(training, path)
    return path


def test_a_file_holds_policies_and_rewards_that_say_nothing_of_an_arm(
    training: StrokeTraining, kept: Path
) -> None:
    taught = load_taught(kept)
    assert taught.policies.digest == training.policies().digest
    assert taught.policies.facts.keys() == training.policies().facts.keys()
    rewards = taught.rewards
    seen = {rewards.columns[index] for index in rewards.strategy_features.indices.tolist()}
    assert seen == {*BALL_NAMES, *PADDLE_NAMES}
    seen = {rewards.columns[index] for index in rewards.task_features.indices.tolist()}
    assert seen == set(BALL_NAMES)


def test_another_arm_learns_from_them_without_being_shown_anything(kept: Path) -> None:
    taught = load_taught(kept)
    run = transfer(taught, UR10E, TINY, retargeting=FEW)
    assert run.training.labels == taught.policies.labels
    assert all(line.endswith("off the path of sawyer") for line in run.account)
    learner = run.training.trainer
    learner.clone()
    cloned = run.training.policies()
    figures = learner.iterate()
    assert np.isfinite(figures["reward"])
    policies = run.training.policies()
    assert policies.digest != cloned.digest
    assert StrokePolicies.from_bytes(policies.to_bytes(), "test", UR10E).robot == UR10E
    for name, value in learner.averaged_rewards.state_dict().items():
        if "indices" not in name:
            assert torch.equal(value, taught.rewards.state_dict()[name]), name


def test_from_nothing_nothing_is_cloned(kept: Path) -> None:
    run = transfer(load_taught(kept), UR10E, TINY, Start.NOTHING, retargeting=FEW)
    learner = run.training.trainer
    before = {name: value.clone() for name, value in learner.policies.state_dict().items()}
    learner.clone()
    for name, value in learner.policies.state_dict().items():
        assert torch.equal(value, before[name]), name
    assert learner.config.policy.reference_price == 0.0


def test_rewards_of_joints_are_refused_on_another_arm(kept: Path) -> None:
    taught = load_taught(kept)
    joints = taught.policies.robot.joint_names
    of_joints = taught.rewards
    of_joints.columns = tuple(
        joints[0] if name == PADDLE_NAMES[0] else name for name in taught.rewards.columns
    )
    with pytest.raises(UserError, match=f"rewards: see {joints[0]}; .* of one arm alone"):
        transfer(Taught(taught.policies, of_joints), UR10E, TINY, retargeting=FEW)


def test_files_that_will_not_do_are_named(training: StrokeTraining, tmp_path: Path) -> None:
    path = tmp_path / "policies.safetensors"
    path.write_bytes(training.policies().to_bytes())
    with pytest.raises(UserError, match=r"policies\.safetensors: holds policies and no rewards"):
        load_taught(path)
    with pytest.raises(UserError, match="is of the robot sawyer, not ur10e"):
        load_taught(path, "ur10e")


def test_nothing_is_written_where_no_reward_was_learned(tmp_path: Path) -> None:
    run = StrokeTraining(shown("forehand-push"), {}, TINY)
    save_rewards(run, tmp_path / REWARDS_FILE)
    assert not (tmp_path / REWARDS_FILE).exists()
