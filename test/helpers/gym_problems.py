"""Small Gymnasium environments whose episodes end, shared by the tests of the library."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.training import train
from msrd_ros.learning.trajectories import Demonstrations

NAMES = ("position", "speed")
STEPS = 30


class Track(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A cart pushed along a line; off the track (2 m from its middle) the episode ends, badly paid.

    Parameters
    ----------
    strength
        Pushes are from minus to plus this.
    breaks_at
        Step after which the speed is NaN; 0: never.
    """

    def __init__(self, strength: float = 1.0, breaks_at: int = 0) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float32)
        self.action_space = gymnasium.spaces.Box(-strength, strength, (1,), np.float32)
        self._strength, self._breaks_at = strength, breaks_at

    def reset(
        self, *, seed: int | None = None, options: Any = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        super().reset(seed=seed)
        self._state = self.np_random.normal(scale=(0.3, 0.1))
        self._steps = 0
        return self._state.astype(np.float32), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        position, speed = self._state
        speed = 0.9 * speed + 0.3 * float(np.clip(action[0] / self._strength, -1.0, 1.0))
        self._state = np.array([position + 0.2 * speed, speed])
        self._steps += 1
        off = abs(self._state[0]) > 2.0
        if self._steps == self._breaks_at:
            self._state[1] = np.nan
        return self._state.astype(np.float32), -10.0 if off else 1.0, off, self._steps >= STEPS, {}


def track_arrays(
    targets: dict[str, float], count: int = 6, strength: float = 1.0, seed: int = 0
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]], list[str]]:
    """Trajectories of drivers who go to a place of their own: observations, actions, labels."""
    rng, track = np.random.default_rng(seed), Track(strength)
    observations, actions, labels = [], [], []
    for label, target in targets.items():
        for _ in range(count):
            seen, _ = track.reset(seed=int(rng.integers(2**31)))
            states, pushes, over = [seen], [], False
            while not over:
                push = 1.5 * (target - seen[0]) - seen[1] + rng.normal(scale=0.1)
                pushes.append(strength * np.clip([push], -1.0, 1.0))
                seen, _, ended, cut, _ = track.step(pushes[-1])
                states.append(seen)
                over = ended or cut
            observations.append(np.array(states, dtype=np.float64))
            actions.append(np.array(pushes))
            labels.append(label)
    return observations, actions, labels


def track_demonstrations(
    targets: dict[str, float] | None = None, count: int = 6, strength: float = 1.0
) -> Demonstrations:
    """The same, ready to learn from; to the left and to the right unless other `targets` are given."""
    arrays = track_arrays(targets or {"left": -1.0, "right": 1.0}, count, strength)
    return demonstrations_from_arrays(*arrays, observation_names=NAMES, action_names=("push",))


def short(iterations: int = 2, cloning_steps: int = 100) -> MSRDConfig:
    """The default recipe, for a first look."""
    config = default_config()
    cloning = replace(config.cloning, steps=cloning_steps, snapshots=(0,), noise_levels=(), restarts=())
    return replace(config, iterations=iterations, episodes=2, cloning=cloning)


def quick(**arguments: Any) -> Learned:
    """A short training on the track."""
    settings = {"demonstrations": track_demonstrations(), "environment": Track, "config": short()}
    return train(**{**settings, "progress": False, **arguments})
