"""Small problems with known solutions, shared by the tests of the learning core."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from msrd_ros.learning.layout import Layout
from msrd_ros.learning.trajectories import Demonstrations

SIDE = 4
CELLS = SIDE * SIDE
DISCOUNT = 0.7
MOVES = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


def next_cells() -> NDArray[np.int64]:
    """``[CELLS, 5]``: where each move leads; walls stop."""
    table = np.empty((CELLS, len(MOVES)), dtype=np.int64)
    for cell in range(CELLS):
        for action, (right, up) in enumerate(MOVES):
            column = int(np.clip(cell % SIDE + right, 0, SIDE - 1))
            row = int(np.clip(cell // SIDE + up, 0, SIDE - 1))
            table[cell, action] = row * SIDE + column
    return table


def true_rewards() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """R0 ``[CELLS]``: be at the right; S_i ``[2, CELLS]``: be high, or be low. The S_i add up to zero."""
    columns, rows = np.arange(CELLS) % SIDE, np.arange(CELLS) // SIDE
    height = (rows - rows.mean()) / 1.5
    return 0.7 * columns.astype(np.float64), 0.6 * np.stack([height, -height])


def soft_optimal(reward: NDArray[np.float64]) -> NDArray[np.float64]:
    """Maximum-entropy optimal policy ``[CELLS, 5]`` for a reward on the next cell."""
    table, value = next_cells(), np.zeros(CELLS)
    for _ in range(400):
        action_value = reward[table] + DISCOUNT * value[table]
        value = logsumexp(action_value, axis=1)
    return np.exp(action_value - value[:, None])


class GridWorld:
    """A walled grid; observations are one-hot cells, the action column is the index of a move."""

    def __init__(self, horizon: int = 20) -> None:
        self.observation_names = tuple(f"cell_{cell}" for cell in range(CELLS))
        self.action_names = ("move",)
        self.horizon = self.acting_steps = horizon
        self._table = next_cells()

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.float64]:
        self._cell = rng.integers(CELLS, size=(strategies, episodes))
        return np.eye(CELLS)[self._cell]

    def step(self, action: NDArray[np.floating]) -> NDArray[np.float64]:
        self._cell = self._table[self._cell, action[..., 0].astype(np.int64)]
        return np.eye(CELLS)[self._cell]


def grid_demonstrations(count: int = 200, seed: int = 0) -> Demonstrations:
    """Trajectories of the two soft-optimal demonstrators."""
    rng = np.random.default_rng(seed)
    world = GridWorld()
    task, own = true_rewards()
    cumulative = np.stack([soft_optimal(task + preference) for preference in own]).cumsum(axis=-1)
    observation = world.reset(2, count, rng)
    observations, actions = [observation], []
    for _ in range(world.horizon):
        probs = cumulative[np.arange(2)[:, None], observation.argmax(axis=-1)]
        action = (probs < rng.random((2, count, 1))).sum(axis=-1, keepdims=True)
        actions.append(np.minimum(action, len(MOVES) - 1))
        observation = world.step(actions[-1])
        observations.append(observation)
    layout = Layout(world.observation_names, world.action_names, ("high", "low"), 1.0)
    return Demonstrations(np.stack(observations, 2), np.stack(actions, 2).astype(np.float64), layout)


class PointMass:
    """A point pushed along a line; after `acting_steps` nobody pushes. Observation: position, speed."""

    observation_names = ("position", "speed")
    action_names = ("push",)

    def __init__(self, horizon: int = 30, acting_steps: int = 20) -> None:
        self.horizon, self.acting_steps = horizon, acting_steps

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.float64]:
        self._state = rng.normal(scale=0.3, size=(strategies, episodes, 2))
        return self._state

    def step(self, action: NDArray[np.floating]) -> NDArray[np.float64]:
        position, speed = self._state[..., 0], self._state[..., 1]
        speed = 0.9 * speed + 0.3 * np.clip(action[..., 0], -1.0, 1.0)
        self._state = np.stack([position + 0.2 * speed, speed], axis=-1)
        return self._state


def point_demonstrations(targets: tuple[float, ...] = (-1.0, 0.0, 1.0), count: int = 6) -> Demonstrations:
    """Each strategy drives the point to a place of its own."""
    rng = np.random.default_rng(7)
    world = PointMass()
    aim = np.array(targets)[:, None]
    observation: Any = world.reset(len(targets), count, rng)
    observations, actions = [observation], []
    for step in range(world.horizon):
        push = np.clip(1.5 * (aim - observation[..., 0]) - observation[..., 1], -1.0, 1.0)[..., None]
        if step < world.acting_steps:
            actions.append(push)
        observation = world.step(push if step < world.acting_steps else np.zeros_like(push))
        observations.append(observation)
    labels = tuple(f"to {target:+.1f}" for target in targets)
    layout = Layout(world.observation_names, world.action_names, labels, 0.02)
    return Demonstrations(np.stack(observations, 2), np.stack(actions, 2), layout)
