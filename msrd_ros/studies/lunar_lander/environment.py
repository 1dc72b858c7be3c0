"""Gymnasium's LunarLander without an end: it lies where it crashed and rests where it landed, for 500 steps.

The truth is FLAIR's, the environment's own reward played on behind the end: -100 in each step after a crash
or out of bounds, +100 in each step at rest, before them the change of the shaping potential less the fuel.
One thing is otherwise: Gymnasium pays +100 for a wreck at rest, too; here a crash stays one.
"""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.environment import GymCollector, GymEnvironment
from msrd_ros.learning.examples.lunar_lander import ACTION_NAMES, ENVIRONMENT, OBSERVATION_NAMES
from msrd_ros.learning.trajectories import Rollouts

EPISODE_STEPS = 500
CONTROL_PERIOD_S = 0.02
LOST, RESTING = -100.0, 100.0
"""What a step pays after a crash or out of bounds, and at rest."""


class Endless(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A lander whose episodes go on behind their end."""

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """As the environment's own, but never over, and lost after a crash."""
        seen, reward, _, _, info = self.env.step(action)
        if self.get_wrapper_attr("game_over"):
            reward = LOST
        return seen, reward, False, False, info


def make_lander() -> Endless:
    """A lander that goes on, without Gymnasium's own time limit and checks."""
    return Endless(gymnasium.make(ENVIRONMENT).unwrapped)


def make_collector(horizon: int = EPISODE_STEPS) -> GymCollector:
    """Where policies are played."""
    return GymCollector(GymEnvironment(make_lander, horizon, OBSERVATION_NAMES, ACTION_NAMES))


def step_rewards(rollouts: Rollouts) -> NDArray[np.float64]:
    """The truth of every step, ``[S, K, T]``."""
    assert rollouts.environment_reward is not None
    return rollouts.environment_reward.astype(np.float64)


def shaping_potential(observations: NDArray[np.floating]) -> NDArray[np.float64]:
    """What Gymnasium's reward is the change of, of states ``[..., 8]``, ``[...]``."""
    x, y, vx, vy, angle, _, left, right = np.moveaxis(np.asarray(observations, dtype=np.float64), -1, 0)
    away = np.hypot(x, y) + np.hypot(vx, vy) + np.abs(angle)
    return np.asarray(-100.0 * away + 10.0 * (left + right))
