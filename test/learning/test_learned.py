"""What was learned: asked, kept, read back, and refused when it is damaged."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from gym_problems import Track, quick, short, track_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import FeatureConfig, MSRDConfig
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.playing import play
from msrd_ros.learning.policy import PolicySet
from msrd_ros.learning.reward_wrapper import LearnedReward
from msrd_ros.learning.training import train

STATES = np.random.default_rng(0).normal(size=(4, 5, 2))


def learn(config: MSRDConfig | None = None, method: str = "msrd") -> Learned:
    """A short training."""
    return train(track_demonstrations(), Track, method, config or short(), progress=False)


@pytest.fixture(scope="module")
def learned() -> Learned:
    return learn()


def test_rewards_add_up_and_keep_the_shape(learned: Learned) -> None:
    task, own = learned.task_reward(STATES), learned.strategy_reward("left", STATES)
    assert task.shape == own.shape == (4, 5)
    assert np.allclose(learned.reward("left", STATES), task + own)
    assert np.allclose(learned.reward("left", STATES, alpha=0.25), task + 0.25 * own)
    assert learned.task_reward(STATES[0, 0]).shape == ()
    assert not np.allclose(own, learned.strategy_reward("right", STATES))


@pytest.mark.parametrize("method", ["msrd", "vanilla_distillation", "airl", "airl_each", "cloning"])
def test_what_is_saved_is_what_was_learned(method: str, tmp_path: Path) -> None:
    before = learn(method=method)
    before.save(tmp_path / "learned.safetensors")
    after = Learned.load(tmp_path / "learned.safetensors")
    assert after.labels == before.labels
    assert after.details == json.loads(json.dumps(before.details))
    for name in before.labels:
        assert np.array_equal(after.policy(name).act(STATES), before.policy(name).act(STATES))
        if method != "cloning":
            assert np.array_equal(after.reward(name, STATES), before.reward(name, STATES))


def test_the_file_is_a_policy_file_as_well(learned: Learned, tmp_path: Path) -> None:
    path = tmp_path / "learned.safetensors"
    learned.save(path)
    assert PolicySet.load(path).digest == learned.policies.digest


def test_rewards_of_actions_are_in_the_environments_units(tmp_path: Path) -> None:
    config = short()
    config = MSRDConfig(**{**vars(config), "reward": type(config.reward)(sees_action=True)})
    demonstrations = track_demonstrations(strength=10.0)
    found = train(demonstrations, lambda: Track(10.0), config=config, progress=False)
    with pytest.raises(UserError, match="see actions as well; pass actions="):
        found.task_reward(STATES)
    pushes = np.full((4, 5, 1), 10.0)
    assert found.rewards is not None
    network, features = found.rewards.task_network, found.rewards.task_features
    with torch.no_grad():
        inputs = torch.cat(
            [features(torch.as_tensor(STATES, dtype=torch.float32)), torch.ones(4, 5, 1)], dim=-1
        )
        expected = network(inputs.reshape(1, -1, 3)).reshape(4, 5).numpy()
    assert np.allclose(found.task_reward(STATES, pushes), expected, atol=1e-5)


def test_what_a_method_does_not_learn_is_said(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="'cloning': learns policies and no reward"):
        learn(method="cloning").task_reward(STATES)
    with pytest.raises(UserError, match="'airl': learns no strategy rewards"):
        learn(method="airl").strategy_reward("left", STATES)
    with pytest.raises(UserError, match="'airl_each': learns no task reward"):
        learn(method="airl_each").task_reward(STATES)


def test_unknown_strategies_and_other_columns_are_named(learned: Learned) -> None:
    for ask in (learned.policy, lambda name: learned.strategy_reward(name, STATES)):
        with pytest.raises(UserError, match="no strategy 'up'; there are left, right"):
            ask("up")
    with pytest.raises(UserError, match=r"\(3,\): the last axis has to be the 2 columns position, speed"):
        learned.task_reward([1.0, 2.0, 3.0])


@pytest.mark.parametrize("damage", ["missing", "nan", "none", "text"])
def test_damaged_files_are_refused(learned: Learned, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "learned.safetensors"
    learned.save(path)
    if damage in ("missing", "nan"):
        with safe_open(path, "np") as file:
            metadata = file.metadata()
        tensors = load_file(path)
        name = "rewards/task_network.weights.0"
        if damage == "missing":
            del tensors[name]
        else:
            tensors[name] = np.full_like(tensors[name], np.nan)
        save_file(tensors, path, metadata)
    elif damage == "text":
        path.write_text("nothing of the kind")
    else:
        path.unlink()
    with pytest.raises(UserError, match=str(path)):
        Learned.load(path)


def test_a_wrapped_environment_pays_the_learned_reward(learned: Learned) -> None:
    plain, paid = Track(), learned.wrap(Track(), "right", alpha=0.5)
    assert isinstance(paid, LearnedReward)
    for track in (plain, paid):
        track.reset(seed=0)
    over = False
    while not over:
        seen, true, over, cut, _ = plain.step(np.ones(1, dtype=np.float32))
        again, reward, *_, info = paid.step(np.ones(1, dtype=np.float32))
        assert np.array_equal(seen, again)
        assert info["environment_reward"] == true
        expected = float(learned.reward("right", seen, alpha=0.5))
        assert reward == pytest.approx(100.0 * expected if over else expected, rel=1e-5)
    assert not cut


def test_the_wrapper_refuses_what_it_cannot_pay(learned: Learned) -> None:
    with pytest.raises(UserError, match="3 observation columns; the rewards were learned on position, speed"):
        LearnedReward(gymnasium.make("Pendulum-v1"), learned, "left")
    with pytest.raises(UserError, match="no strategy 'up'"):
        LearnedReward(Track(), learned, "up")


def test_policies_are_played_in_an_environment() -> None:
    found = quick(method="cloning", config=short(cloning_steps=400))
    returns = play(found.policy("left"), Track(), episodes=3)
    assert returns == [30.0, 30.0, 30.0]


def test_features_are_kept(tmp_path: Path) -> None:
    config = short()
    reward = type(config.reward)(task_features=FeatureConfig(("speed",)))
    found = learn(MSRDConfig(**{**vars(config), "reward": reward}))
    moved = STATES + np.array([5.0, 0.0])
    assert np.array_equal(found.task_reward(STATES), found.task_reward(moved))
    found.save(tmp_path / "learned.safetensors")
    again = Learned.load(tmp_path / "learned.safetensors")
    assert np.array_equal(again.task_reward(STATES), found.task_reward(STATES))
