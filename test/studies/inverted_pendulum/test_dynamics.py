"""The compiled pendulum against MuJoCo, state by state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.studies.inverted_pendulum.dynamics import PendulumBody, advance
from msrd_ros.studies.inverted_pendulum.environment import InvertedPendulum, has_fallen, task_reward
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.truths import pendulum_features

pytestmark = pytest.mark.slow

mujoco = pytest.importorskip("mujoco")
gymnasium = pytest.importorskip("gymnasium")


def environment() -> Any:
    return gymnasium.make("InvertedPendulum-v5").unwrapped


def test_body_is_that_of_gymnasiums_model() -> None:
    model = environment().model
    body = PendulumBody()
    assert model.body_mass[1] == pytest.approx(body.cart_mass_kg, rel=1e-12)
    assert model.body_mass[2] == pytest.approx(body.pole_mass_kg, rel=1e-12)
    assert model.body_inertia[2][0] == pytest.approx(body.pole_inertia_kg_m2, rel=1e-12)
    assert body.inverse_weights() == pytest.approx(model.dof_invweight0, rel=1e-9)


@pytest.mark.parametrize("kind", ["balancing", "swinging", "against the limits"])
def test_steps_equal_mujoco(kind: str) -> None:
    world = environment()
    rng = np.random.default_rng(0)
    worst = 0.0
    touched = 0
    for _ in range(40):
        spread = {"balancing": (0.3, 0.1, 0.3, 0.3), "swinging": (0.3, 0.4, 0.5, 1.0)}.get(
            kind, (1.0, 1.57, 2.0, 4.0)
        )
        state = rng.uniform(-1.0, 1.0, 4) * np.array(spread)
        if kind == "against the limits":
            state[:2] = np.sign(state[:2]) * np.array([0.97, 1.5])
        ours = state[None].copy()
        for _ in range(10):
            world.set_state(ours[0, :2], ours[0, 2:])  # judged step by step, so that chaos does not decide
            control = rng.uniform(-4.0, 4.0, 1)
            world.do_simulation(np.clip(control, -3.0, 3.0), 2)
            advance(ours, control, PendulumBody().as_array())
            theirs = np.concatenate([world.data.qpos, world.data.qvel])
            worst = max(worst, float(np.abs(ours[0] - theirs).max()))
            touched += int(abs(ours[0, 0]) > 1.0 or abs(ours[0, 1]) > np.pi / 2.0)
    assert worst < (1e-6 if kind == "against the limits" else 1e-12)
    assert (touched > 50) == (kind == "against the limits")


def test_an_episode_equals_mujoco() -> None:
    world = environment()
    rng = np.random.default_rng(3)
    ours = rng.uniform(-0.01, 0.01, (1, 4))
    world.set_state(ours[0, :2], ours[0, 2:])
    gains = 0.3 * np.array([1.0, 20.0, 1.2, 3.0])
    theirs = ours[0].copy()
    for _ in range(1000):
        noise = 0.1 * rng.standard_normal()
        world.do_simulation(np.clip([gains @ theirs + noise], -3.0, 3.0), 2)
        advance(ours, np.array([gains @ ours[0] + noise]), PendulumBody().as_array())
        theirs = np.concatenate([world.data.qpos, world.data.qvel])
    assert np.abs(ours[0] - theirs).max() < 1e-9
    assert abs(ours[0, 1]) < 0.2


def test_changed_bodies_match_a_changed_model() -> None:
    world = environment()
    model, data = world.model, world.data
    model.body_mass[2] *= 1.3
    model.body_inertia[2] *= 1.3**3
    model.body_ipos[2] *= 1.3
    model.dof_damping[0] *= 2.0
    mujoco.mj_setConst(model, data)
    rng = np.random.default_rng(1)
    body = PendulumBody().changed(pole_length=1.3, cart_friction=2.0).as_array()
    ours = rng.uniform(-0.1, 0.1, (1, 4))
    world.set_state(ours[0, :2], ours[0, 2:])
    for _ in range(5):
        control = rng.uniform(-1.0, 1.0, 1)
        world.do_simulation(control, 2)
        advance(ours, control, body)
    assert np.abs(ours[0] - np.concatenate([data.qpos, data.qvel])).max() < 1e-12


def test_energy_is_only_lost() -> None:
    body = PendulumBody()
    states = np.array([[0.0, 1.0, 0.0, 0.0]])
    energies = []
    for _ in range(6):
        _, q, v, w = states[0]
        angle, length = q + body.centre_angle_rad, body.centre_distance_m
        kinetic = 0.5 * body.cart_mass_kg * v**2 + 0.5 * body.pole_inertia_kg_m2 * w**2
        speed = np.array([v + length * w * np.cos(angle), -length * w * np.sin(angle)])
        kinetic += 0.5 * body.pole_mass_kg * speed @ speed
        energies.append(kinetic + body.pole_mass_kg * 9.81 * length * np.cos(angle))
        advance(states, np.zeros(1), body.as_array())
    assert np.all(np.diff(energies) < 0.0)


def test_environment_is_reproducible_and_noise_is_its_own() -> None:
    def play(noise: float, seed: int) -> np.ndarray:
        world = InvertedPendulum(20, random_actions=noise)
        world.reset(2, 3, np.random.default_rng(seed))
        return np.stack([world.step(np.zeros((2, 3, 1))) for _ in range(20)], axis=2)

    assert np.array_equal(play(0.3, 1), play(0.3, 1))
    assert not np.array_equal(play(0.3, 1), play(0.3, 2))
    assert not np.array_equal(play(0.3, 1), play(0.0, 1))


def test_truth_and_falls() -> None:
    states = np.zeros((2, 5, 4))
    states[0, 3, 1], states[1, 2, 1] = -0.6, 0.4
    assert task_reward(states)[0, 3] == -0.6
    assert has_fallen(states).tolist() == [True, False]


def test_compiled_rollouts_equal_the_batched_ones() -> None:
    generator = torch.Generator().manual_seed(0)
    policies = GaussianPolicies(3, pendulum_features(), 1, (32, 32), -1.0, -3.0, 0.0, generator)
    policies.set_flat(policies.flat() * 3.0)
    expected = BatchedCollector(InvertedPendulum(50)).collect(policies, 2, np.random.default_rng(4))
    found = PendulumCollector(50).collect(policies, 2, np.random.default_rng(4))
    np.testing.assert_allclose(found.observations, expected.observations, atol=2e-4)
    np.testing.assert_allclose(found.actions, expected.actions, atol=2e-4)
    still = PendulumCollector(50).collect(policies, 2, np.random.default_rng(4), deterministic=True)
    mean = policies.act(still.observations[:, :, 7])
    np.testing.assert_allclose(mean, still.actions[:, :, 7], atol=1e-5)
