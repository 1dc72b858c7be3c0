"""Learned rewards for anybody's reinforcement learning."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np

from msrd_ros.core.errors import UserError
from msrd_ros.learning.learned import Learned


class LearnedReward(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment that pays R0 + alpha S_i; what it would have paid is ``info["environment_reward"]``.

    Learned rewards say what it is worth to be in a state, and mean no harm by being negative. So that an
    episode's end is neither a way out nor a loss, the last step pays what staying there for ever is worth.

    Parameters
    ----------
    environment
        One with the columns that the rewards were learned on.
    learned
        The rewards.
    name
        Of the strategy.
    alpha
        Weight of S_i; 0 is the task alone, None as it was trained.
    discount
        gamma of whoever learns.

    Raises
    ------
    UserError
        If there is no such strategy, no reward, or the environment's columns are not as many.
    """

    def __init__(
        self,
        environment: gymnasium.Env[Any, Any],
        learned: Learned,
        name: str,
        alpha: float | None = None,
        discount: float = 0.99,
    ) -> None:
        super().__init__(environment)
        self._learned, self._name, self._alpha, self._discount = learned, name, alpha, discount
        width = gymnasium.spaces.flatdim(environment.observation_space)
        if width != len(learned.layout.observation_names):
            raise UserError(
                f"environment {environment}: {width} observation columns; the rewards were learned on "
                f"{', '.join(learned.layout.observation_names)}"
            )
        learned.reward(name, np.zeros(width), alpha, np.zeros(len(learned.layout.action_names)))

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """As the environment's own, but for the reward."""
        observation, paid, terminated, truncated, info = self.env.step(action)
        space = self.env.observation_space
        state = np.asarray(gymnasium.spaces.flatten(space, observation))
        reward = float(self._learned.reward(self._name, state, self._alpha, np.ravel(action)))
        if terminated:
            reward /= 1.0 - self._discount
        return observation, reward, terminated, truncated, {**info, "environment_reward": float(paid)}
