"""The inverted pendulum without termination: the paper's first simulated task."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.layout import Layout
from msrd_ros.studies.inverted_pendulum.dynamics import (
    CONTROL_LIMIT,
    CONTROL_PERIOD_S,
    PendulumBody,
    advance,
)

OBSERVATION_NAMES = ("cart_position", "pole_angle", "cart_velocity", "pole_rate")
ACTION_NAMES = ("cart_force",)
EPISODE_STEPS = 1000
RESET_NOISE = 0.01
FALLEN_RAD = 0.5


class InvertedPendulum:
    """Episodes side by side; observation: cart position, pole angle, their rates.

    Parameters
    ----------
    horizon
        Steps of an episode, of 0.04 s each; the paper's timeout is 1,000.
    body
        Masses and lengths, for studies of transfer.
    random_actions
        Probability with which an action is replaced by a uniformly random one, one value for all or
        ``[S, K]``: the noise injection (Brown et al., 2019) that makes trajectories of various quality.
    """

    observation_names = OBSERVATION_NAMES
    action_names = ACTION_NAMES

    def __init__(
        self,
        horizon: int = EPISODE_STEPS,
        body: PendulumBody | None = None,
        random_actions: float | NDArray[np.float64] = 0.0,
    ) -> None:
        self.horizon = self.acting_steps = horizon
        self._body = (body or PendulumBody()).as_array()
        self._random_actions = np.asarray(random_actions, dtype=np.float64)
        self._states = np.zeros((0, 4))
        self._shape = (0, 0)
        self._rng = np.random.default_rng(0)

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Upright and centred but for uniform noise of 0.01 in every coordinate, as Gymnasium has it."""
        self._shape = (strategies, episodes)
        self._states = rng.uniform(-RESET_NOISE, RESET_NOISE, size=(strategies * episodes, 4))
        self._rng = rng
        return self._states.reshape(*self._shape, 4).copy()

    def step(self, action: NDArray[np.floating]) -> NDArray[np.float64]:
        """Apply ``action [S, K, 1]`` for 0.04 s."""
        control = np.asarray(action[..., 0], dtype=np.float64)
        if self._random_actions.any():
            replaced = self._rng.random(self._shape) < self._random_actions
            drawn = self._rng.uniform(-CONTROL_LIMIT, CONTROL_LIMIT, self._shape)
            control = np.where(replaced, drawn, control)
        advance(self._states, np.ascontiguousarray(control).reshape(-1), self._body)
        return self._states.reshape(*self._shape, 4).copy()


def task_reward(observations: NDArray[np.floating]) -> NDArray[np.float64]:
    """True task reward of states ``[..., 4]``: minus the pole's absolute angle (paper, Section 5.1)."""
    return -np.abs(np.asarray(observations[..., 1], dtype=np.float64))


def has_fallen(observations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether the pole ever leaned more than 0.5 rad in trajectories ``[..., T+1, 4]``."""
    return np.asarray((np.abs(observations[..., 1]) > FALLEN_RAD).any(axis=-1))


def pendulum_layout(labels: tuple[str, ...]) -> Layout:
    """Layout of demonstrations and policies on this task."""
    return Layout(OBSERVATION_NAMES, ACTION_NAMES, labels, CONTROL_PERIOD_S)
