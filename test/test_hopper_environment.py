"""The batched Hopper against Gymnasium's, and what it lets the learner see."""

from __future__ import annotations

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from msrd_ros.experiments.hopper.environment import (  # noqa: E402
    FEATURE_NAMES,
    OBSERVATION_NAMES,
    Hopper,
    HopperBody,
    is_healthy,
    mean_speed,
    task_reward,
)


def test_equal_to_gymnasium_step_by_step() -> None:
    batched = Hopper(60)
    first = batched.reset(1, 3, np.random.default_rng(0))
    actions = np.random.default_rng(1).uniform(-1.5, 1.5, (60, 3, 3))
    ours = [first[0]] + [batched.step(action[None])[0] for action in actions]
    for episode in range(3):
        single = gymnasium.make(
            "Hopper-v5",
            terminate_when_unhealthy=False,
            healthy_reward=0.0,
            ctrl_cost_weight=0.0,
        ).unwrapped
        single.reset(seed=0)
        state = first[0, episode]
        single.set_state(state[:6], state[6:])
        for step, action in enumerate(actions[:, episode]):
            seen, reward, *_ = single.step(np.clip(action, -1.0, 1.0))
            np.testing.assert_allclose(ours[step + 1][episode, 1:], seen, atol=1e-9)
            speed = task_reward(np.stack([ours[step][episode], ours[step + 1][episode]]))
            assert speed[0] == pytest.approx(reward, abs=1e-9)


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


def test_distance_is_for_judging_only() -> None:
    assert OBSERVATION_NAMES[1:] == FEATURE_NAMES
    track = np.zeros((5, 12))
    track[:, 0] = [0.0, 0.008, 0.016, 0.024, 0.032]
    assert mean_speed(track) == pytest.approx(1.0)
