"""Learned policies in an environment, and what it pays them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from msrd_ros.learning.policy import Policy


def play(
    policy: Policy, environment: str | gymnasium.Env[Any, Any], episodes: int = 10, seed: int = 0
) -> list[float]:
    """Returns of the environment's own reward, one for each episode; the policy's mean actions are played."""
    played = gymnasium.make(environment) if isinstance(environment, str) else environment
    observed, acts = played.observation_space, played.action_space
    returns = []
    for episode in range(episodes):
        observation, _ = played.reset(seed=seed + episode)
        total, over = 0.0, False
        while not over:
            action = policy.act(np.asarray(gymnasium.spaces.flatten(observed, observation)))
            if isinstance(acts, gymnasium.spaces.Box):
                action = np.clip(action.reshape(acts.shape), acts.low, acts.high).astype(acts.dtype)
            observation, reward, terminated, truncated, _ = played.step(action)
            total, over = total + float(reward), terminated or truncated
        returns.append(total)
    if played is not environment:
        played.close()
    return returns
