"""Policies and pendulums stepped together in compiled code: whole episodes without coming back to Python."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.rollouts import BatchedCollector, draw_action_noise
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.studies.inverted_pendulum.dynamics import PendulumBody, advance
from msrd_ros.studies.inverted_pendulum.environment import EPISODE_STEPS, InvertedPendulum


@njit(cache=True, nogil=True)
def _layer(inputs, weights, biases, outputs, squash):  # type: ignore[no-untyped-def]
    for j in range(outputs.shape[0]):
        outputs[j] = biases[0, j]
    for i in range(inputs.shape[0]):
        for j in range(outputs.shape[0]):
            outputs[j] += inputs[i] * weights[i, j]
    if squash:
        for j in range(outputs.shape[0]):
            outputs[j] = math.tanh(outputs[j])


@njit(cache=True, nogil=True)
def _play(  # type: ignore[no-untyped-def]
    states,
    offset,
    scale,
    w1,
    b1,
    w2,
    b2,
    w3,
    b3,
    noise,
    body,
    observations,
    actions,
):
    strategies, episodes, steps = noise.shape
    features = np.empty(4, dtype=np.float32)
    first = np.empty(b1.shape[2], dtype=np.float32)
    second = np.empty(b2.shape[2], dtype=np.float32)
    control = np.empty(1, dtype=np.float32)
    controls = np.empty(1)
    for s in range(strategies):
        for k in range(episodes):
            state = states[s, k : k + 1]
            for step in range(steps):
                for column in range(4):
                    value = np.float32(state[0, column])
                    observations[s, k, step, column] = value
                    features[column] = (value - offset[column]) / scale[column]
                _layer(features, w1[s], b1[s], first, True)
                _layer(first, w2[s], b2[s], second, True)
                _layer(second, w3[s], b3[s], control, False)
                control[0] += noise[s, k, step]
                actions[s, k, step, 0] = control[0]
                controls[0] = control[0]
                advance(state, controls, body)
            for column in range(4):
                observations[s, k, steps, column] = state[0, column]


class PendulumCollector:
    """A `Collector` like `BatchedCollector` around `InvertedPendulum`, several times as fast.

    Parameters
    ----------
    horizon
        Steps of an episode.
    body
        Masses and lengths.
    """

    def __init__(self, horizon: int = EPISODE_STEPS, body: PendulumBody | None = None) -> None:
        self._environment = InvertedPendulum(horizon, body)
        self._body = (body or PendulumBody()).as_array()
        self._horizon = horizon

    def collect(
        self, policies: Policies, episodes: int, rng: np.random.Generator, deterministic: bool = False
    ) -> Rollouts:
        """Play `episodes` episodes with every policy; draws and results as `BatchedCollector`'s."""
        if not isinstance(policies, GaussianPolicies) or len(policies.network.weights) != 3:
            return BatchedCollector(self._environment).collect(policies, episodes, rng, deterministic)
        noise = draw_action_noise(policies, episodes, self._horizon, rng)[..., 0]
        deviation = policies.log_std.detach().exp().numpy()
        noise *= 0.0 if deterministic else deviation
        states = self._environment.reset(policies.strategies, episodes, rng)
        shape = (policies.strategies, episodes)
        observations = np.empty((*shape, self._horizon + 1, 4), dtype=np.float32)
        actions = np.empty((*shape, self._horizon, 1), dtype=np.float32)
        offset, scale, *weights = _numbers(policies)
        _play(states, offset, scale, *weights, noise, self._body, observations, actions)  # type: ignore[call-arg]
        log_probs = policies.rollout_log_probs(observations[:, :, :-1], actions)
        return Rollouts(observations, actions, log_probs)


def _numbers(policies: GaussianPolicies) -> list[NDArray[np.float32]]:
    """Scaling and weights in the order of `_play`."""
    found = [policies.features.offset.numpy(), policies.features.scale.numpy()]
    for weight, bias in zip(policies.network.weights, policies.network.biases, strict=True):
        found += [weight.detach().numpy(), bias.detach().numpy()]
    return found
