"""Where trajectories come from: environments stepped side by side, and collectors around them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts


class BatchedEnvironment(Protocol):
    """Many episodes side by side, stepped together.

    Attributes
    ----------
    observation_names, action_names
        Names of the columns.
    horizon
        Steps of an episode, T.
    acting_steps
        Steps in which the policy acts, T_act <= T; later actions are zero and to be ignored.
    """

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observed columns."""
        ...

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the action's columns."""
        ...

    @property
    def horizon(self) -> int:
        """Steps of an episode."""
        ...

    @property
    def acting_steps(self) -> int:
        """Steps in which the policy acts."""
        ...

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.floating]:
        """Start `episodes` episodes for each strategy; first observations ``[S, K, O]``."""
        ...

    def step(self, action: NDArray[np.floating]) -> NDArray[np.floating]:
        """Apply ``action [S, K, A]``; next observations ``[S, K, O]``."""
        ...


class Collector(Protocol):
    """Anything that can play policies: a batched simulator, worker processes, a robot over topics."""

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        """Play `episodes` episodes with every policy (Algorithm 1, line 6)."""
        ...


def draw_action_noise(
    policies: Policies, episodes: int, acting_steps: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Exploration noise of whole episodes, ``[S, K, T_act, A]`` standard normal.

    Drawn before the first step and apart from the environment's draws, so that collectors which play
    episodes in another order or place still give the same trajectories.
    """
    shape = (policies.strategies, episodes, acting_steps, policies.noise_width)
    return rng.standard_normal(shape, dtype=np.float32)


class BatchedCollector:
    """Plays all episodes of all strategies in lockstep in a `BatchedEnvironment`.

    Parameters
    ----------
    environment
        Where to play.
    """

    def __init__(self, environment: BatchedEnvironment) -> None:
        self.environment = environment

    def collect(
        self, policies: Policies, episodes: int, rng: np.random.Generator, deterministic: bool = False
    ) -> Rollouts:
        """Play `episodes` episodes with every policy; `deterministic` plays the mean actions."""
        environment = self.environment
        acting, horizon = environment.acting_steps, environment.horizon
        noise = draw_action_noise(policies, episodes, acting, rng)
        observation = environment.reset(policies.strategies, episodes, rng)
        shape = (policies.strategies, episodes)
        observations = np.empty((*shape, horizon + 1, observation.shape[-1]), dtype=np.float32)
        actions = np.empty((*shape, acting, policies.action_width), dtype=np.float32)
        observations[:, :, 0] = observation
        rest = np.zeros((*shape, policies.action_width), dtype=np.float32)
        for step in range(horizon):
            action = rest
            if step < acting:
                action = policies.act(observations[:, :, step], None if deterministic else noise[:, :, step])
                actions[:, :, step] = action
            observations[:, :, step + 1] = environment.step(action)
        log_probs = policies.rollout_log_probs(observations[:, :, :acting], actions)
        return Rollouts(observations, actions, log_probs)
