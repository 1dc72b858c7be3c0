"""The batched Hopper against Gymnasium's, and what it lets the learner see."""

from __future__ import annotations

import numpy as np
import pytest
import torch

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from msrd_ros.studies.hopper.demonstrators import gait_policies  # noqa: E402
from msrd_ros.studies.hopper.environment import (  # noqa: E402
    FEATURE_NAMES,
    OBSERVATION_NAMES,
    Hopper,
    HopperBody,
    is_healthy,
    mean_speed,
    task_reward,
)
from msrd_ros.studies.hopper.task import make_autoreset, make_collector  # noqa: E402

pytestmark = pytest.mark.slow


def test_equal_to_gymnasium_step_by_step() -> None:
    batched = Hopper(60)
    first = batched.reset(1, 3, np.random.default_rng(0))
    start = np.concatenate([np.zeros((3, 1)), first[0, :, 1:]], axis=1)
    actions = np.random.default_rng(1).uniform(-1.5, 1.5, (60, 3, 3))
    ours = [batched.step(action[None])[0] for action in actions]
    for episode in range(3):
        single = gymnasium.make(
            "Hopper-v5",
            terminate_when_unhealthy=False,
            healthy_reward=0.0,
            ctrl_cost_weight=0.0,
        ).unwrapped
        single.reset(seed=0)
        state = start[episode]
        single.set_state(state[:6], state[6:])
        for step, action in enumerate(actions[:, episode]):
            seen, reward, *_ = single.step(np.clip(action, -1.0, 1.0))
            np.testing.assert_allclose(ours[step][episode, 1:], seen, atol=1e-9)
            assert task_reward(ours[step][episode]) == pytest.approx(reward, abs=1e-9)


def test_upright_strategies_start_again_after_a_fall() -> None:
    hopper = Hopper(200, autoreset=(True, False))
    hopper.reset(2, 3, np.random.default_rng(5))
    states = np.stack([hopper.step(np.zeros((2, 3, 3))) for _ in range(200)], axis=2)
    healthy = is_healthy(states)
    falls = np.argwhere(~healthy[0])
    assert len(falls) >= 2
    for episode, step in falls:
        if step + 1 < 200:
            assert healthy[0, episode, step + 1]
            assert states[0, episode, step + 1, 0] == 0.0
    assert not healthy[1, :, -1].any()


def test_bad_examples_start_again_whenever_they_fall() -> None:
    policies = gait_policies(2, torch.Generator().manual_seed(0), 3.0, 3.0)
    for maker, most in ((make_autoreset, 0.2), (make_collector, 1.0)):
        played = maker(200).collect(policies, 3, np.random.default_rng(6)).observations
        down = ~is_healthy(played)
        assert 0.0 < down.mean() < most
        again = down[..., 1:] & down[..., :-1]
        assert again.any() == (maker is make_collector)


def test_goes_on_after_a_fall_for_the_whole_horizon() -> None:
    hopper = Hopper(200)
    hopper.reset(1, 4, np.random.default_rng(2))
    states = np.stack([hopper.step(np.zeros((1, 4, 3))) for _ in range(200)], axis=2)
    assert not is_healthy(states)[:, :, -1].any()
    assert np.isfinite(states).all()
    assert states[..., 1].min() > 0.0


def test_same_seed_gives_the_same_episodes() -> None:
    def play() -> np.ndarray:
        rng = np.random.default_rng(3)
        hopper = Hopper(20, random_actions=0.5)
        hopper.reset(2, 2, rng)
        return np.stack([hopper.step(np.full((2, 2, 3), 0.3)) for _ in range(20)])

    assert np.array_equal(play(), play())


def test_random_actions_replace_as_many_as_asked_for() -> None:
    levels = np.array([[0.0, 1.0]])
    still, noisy = Hopper(30), Hopper(30, random_actions=levels)
    still.reset(1, 2, np.random.default_rng(4))
    noisy.reset(1, 2, np.random.default_rng(4))
    for _ in range(30):
        quiet, shaken = still.step(np.zeros((1, 2, 3))), noisy.step(np.zeros((1, 2, 3)))
    assert np.array_equal(quiet[0, 0], shaken[0, 0])
    assert not np.allclose(quiet[0, 1], shaken[0, 1], atol=1e-2)


def test_changed_body_is_heavier_and_slips_more() -> None:
    standard, changed = HopperBody().model(), HopperBody(mass=1.2, friction=0.5).model()
    assert changed.body_mass.sum() == pytest.approx(1.2 * standard.body_mass.sum())
    assert changed.geom_friction == pytest.approx(0.5 * standard.geom_friction)
    assert changed.geom_size == pytest.approx(standard.geom_size)


def test_true_reward_is_for_judging_only() -> None:
    assert OBSERVATION_NAMES[1:] == FEATURE_NAMES
    track = np.ones((2, 5, 12))
    track[:, 1:, 0] = [[1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 2.0]]
    assert mean_speed(track).tolist() == [2.5, 0.5]
