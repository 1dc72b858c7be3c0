"""Environments of Gymnasium as places where many episodes are played side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Rollouts

if TYPE_CHECKING:
    import gymnasium

EnvironmentMaker: TypeAlias = "str | gymnasium.Env[Any, Any] | Callable[[], gymnasium.Env[Any, Any]]"
"""An id that Gymnasium knows, an environment (copies are made by its specification), or what makes one."""


class GymEnvironment:
    """Copies of a Gymnasium environment, stepped together; a `BatchedEnvironment`.

    An episode that ends stays where it ended until the horizon (see `endings`); one that the environment
    truncates is cut off there.

    Parameters
    ----------
    make
        The environment: an id, an environment or what makes one. Observations of several parts are
        flattened; actions are a box, clipped to its bounds.
    horizon
        Steps of an episode at most; None: what the environment's own time limit says.
    observation_names, action_names
        Names of the columns, in order; empty: numbered, or by the keys of a dictionary. Names that are given
        have to be the demonstrations'.
    autoreset
        Whether an episode that ended starts again in the next step instead of staying where it ended.
    scale
        How the environment's actions follow from those that it is given; None: they are the same.

    Raises
    ------
    UserError
        If there is no such environment, its spaces are no arrays of numbers, names do not go with them, or it
        has no time limit and `horizon` is None.
    """

    def __init__(
        self,
        make: EnvironmentMaker,
        horizon: int | None = None,
        observation_names: Sequence[str] = (),
        action_names: Sequence[str] = (),
        autoreset: bool = False,
        scale: ActionScale | None = None,
    ) -> None:
        from gymnasium import spaces

        self._scale = scale
        self._make = _maker(make)
        first = self._make()
        self._copies = [first]
        self._space = first.observation_space
        if not isinstance(first.action_space, spaces.Box):
            raise UserError(
                f"environment {first}: actions {first.action_space} are no Box, which all methods need"
            )
        if not self._space.is_np_flattenable:
            raise UserError(f"environment {first}: observations {self._space} are no array of numbers")
        self._action_space = first.action_space
        self.named = bool(observation_names), bool(action_names)
        width, actions = spaces.flatdim(self._space), spaces.flatdim(first.action_space)
        self.observation_names = tuple(observation_names) or _column_names(self._space, "observation")
        self.action_names = tuple(action_names) or _column_names(first.action_space, "action")
        for kind, names, columns in (
            ("observation", self.observation_names, width),
            ("action", self.action_names, actions),
        ):
            if len(names) != columns:
                raise UserError(
                    f"environment {first}: {len(names)} {kind} names for {columns} columns; give one each"
                )
        self.time_limit = first.spec.max_episode_steps if first.spec is not None else None
        steps = horizon or self.time_limit
        if steps is None:
            raise UserError(f"environment {first} has no time limit; say how long episodes are with horizon=")
        self.horizon = self.acting_steps = steps
        self._autoreset = autoreset
        self._shape = (0, 0)

    @property
    def action_bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest actions, ``[A]`` each; infinite where there is no bound."""
        space = self._action_space
        return space.low.ravel().astype(np.float64), space.high.ravel().astype(np.float64)

    def copy(self, autoreset: bool = False, scale: ActionScale | None = None) -> GymEnvironment:
        """The same environment, with actions in other units if `scale` is given."""
        return GymEnvironment(
            self._make, self.horizon, self.observation_names, self.action_names, autoreset, scale
        )

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.float32]:
        """Start every copy with a seed of its own."""
        count = strategies * episodes
        while len(self._copies) < count:
            self._copies.append(self._make())
        self._shape, self._rng = (strategies, episodes), rng
        self.acting = np.full(count, self.horizon, dtype=np.int64)
        self.lengths = np.full(count, self.horizon, dtype=np.int64)
        self.rewards = np.zeros((count, self.horizon), dtype=np.float32)
        self._going = np.ones(count, dtype=bool)
        self._ended = np.zeros(count, dtype=bool)
        self._clock = 0
        self._seen = np.stack([self._start(index) for index in range(count)])
        return self._seen.reshape(*self._shape, -1).copy()

    def step(self, action: NDArray[np.floating]) -> NDArray[np.float32]:
        """Apply ``action [S, K, A]``, clipped to the environment's bounds, to every episode that goes on."""
        space = self._action_space
        if self._scale is not None:
            action = self._scale.from_unit(action)
        given = np.asarray(action, dtype=space.dtype).reshape(-1, *space.shape).clip(space.low, space.high)
        for index in np.flatnonzero(self._going):
            if self._ended[index]:
                self._seen[index], self._ended[index] = self._start(int(index)), False
                continue
            seen, reward, terminated, truncated, _ = self._copies[index].step(given[index])
            self._seen[index] = self._flatten(seen)
            self.rewards[index, self._clock] = reward
            if terminated and self._autoreset:
                self._ended[index] = True
            elif terminated or truncated:
                self._going[index] = False
                self.acting[index] = self._clock + 1
                if not terminated:
                    self.lengths[index] = self._clock + 1
        self._clock += 1
        return self._seen.reshape(*self._shape, -1).copy()

    def close(self) -> None:
        """Close all copies."""
        for copy in self._copies:
            copy.close()

    def _start(self, index: int) -> NDArray[np.float32]:
        seen, _ = self._copies[index].reset(seed=int(self._rng.integers(2**31)))
        return self._flatten(seen)

    def _flatten(self, observation: Any) -> NDArray[np.float32]:
        from gymnasium import spaces

        return np.asarray(spaces.flatten(self._space, observation), dtype=np.float32)


class GymCollector(BatchedCollector):
    """Plays policies in a `GymEnvironment` and notes where episodes ended and what they were paid.

    Parameters
    ----------
    environment
        Where to play.
    """

    environment: GymEnvironment

    def collect(
        self, policies: Policies, episodes: int, rng: np.random.Generator, deterministic: bool = False
    ) -> Rollouts:
        """Play `episodes` episodes with every policy; `deterministic` plays the mean actions."""
        played = super().collect(policies, episodes, rng, deterministic)
        shape, environment = played.actions.shape[:2], self.environment
        acting = environment.acting.reshape(shape)
        over = np.arange(environment.horizon) >= acting[..., None]
        played.actions[over], played.log_probs[over] = 0.0, 0.0
        return replace(
            played,
            acting=acting,
            lengths=environment.lengths.reshape(shape),
            environment_reward=environment.rewards.reshape(*shape, -1),
        )


def _maker(make: EnvironmentMaker) -> Callable[[], gymnasium.Env[Any, Any]]:
    import gymnasium

    if isinstance(make, gymnasium.Env):
        specification = make.spec
        if specification is None:
            raise UserError(f"environment {make} cannot be copied; give a function that makes one instead")
        return lambda: gymnasium.make(specification)
    if not isinstance(make, str):
        return make

    def by_id() -> gymnasium.Env[Any, Any]:
        try:
            return gymnasium.make(make)
        except gymnasium.error.Error as error:
            raise UserError(f"environment {make!r}: {error}") from None

    return by_id


def _column_names(space: Any, kind: str) -> tuple[str, ...]:
    """Keys of a dictionary, numbered where they have several columns; else numbers."""
    from gymnasium import spaces

    if not isinstance(space, spaces.Dict):
        return tuple(f"{kind}_{index}" for index in range(spaces.flatdim(space)))
    names: list[str] = []
    for key, part in space.spaces.items():
        width = spaces.flatdim(part)
        names += [key] if width == 1 else [f"{key}_{index}" for index in range(width)]
    return tuple(names)
