"""Pools of transitions to sample from: the demonstrations, and a replay of what generators did."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from msrd_ros.learning.trajectories import Demonstrations, Transitions


class DemonstrationPool:
    """Samples transitions from the demonstrations of each strategy (Algorithm 1, line 7).

    Parameters
    ----------
    demonstrations
        All strategies' demonstrations; trajectories may differ in length.
    """

    def __init__(self, demonstrations: Demonstrations) -> None:
        observations = torch.as_tensor(demonstrations.observations, dtype=torch.float32)
        actions = torch.as_tensor(demonstrations.actions, dtype=torch.float32)
        steps = demonstrations.step_counts()
        self.horizon = demonstrations.horizon
        self.transitions = Transitions.of(
            torch.nan_to_num(observations), torch.nan_to_num(actions), acting_steps=demonstrations.acting
        )
        # Demonstrations of each strategy that exist, first in the order of the data; padding repeats none.
        exists = torch.as_tensor(steps > 0)
        self._counts = exists.sum(dim=1)
        self._order = torch.argsort((~exists).to(torch.int8), dim=1, stable=True)
        self._steps = torch.as_tensor(steps)

    def everything(self) -> Transitions:
        """All transitions of all strategies in one row, ``[1, N]``."""
        strategies, most = self._steps.shape
        valid = torch.arange(self.horizon) < self._steps[..., None]
        packed = self.transitions.packed.reshape(strategies, most, self.horizon, -1)[valid]
        return Transitions(packed[None], self.transitions.observation_width, self.transitions.action_width)

    def states(self) -> Tensor:
        """All states that demonstrations lead to, of all strategies, ``[N, O]``."""
        return self.everything().next_observation[0]

    def choose(self, count: int | None, generator: torch.Generator) -> Tensor:
        """K demonstrations of each strategy without repeats: indices ``[S, K]``; None takes all."""
        strategies, most = self._order.shape
        fewest = int(self._counts.min())
        if count is None or count >= fewest:
            draws = torch.arange(most).expand(strategies, most)
            return torch.gather(self._order, 1, draws % self._counts[:, None])
        keys = torch.rand(strategies, most, generator=generator)
        keys[torch.arange(most) >= self._counts[:, None]] = 2.0
        return torch.gather(self._order, 1, keys.argsort(dim=1)[:, :count])

    def sample(self, chosen: Tensor, count: int, generator: torch.Generator) -> Transitions:
        """Draw `count` transitions of each strategy from the `chosen [S, K]` demonstrations."""
        strategies = chosen.shape[0]
        pick = torch.randint(chosen.shape[1], (strategies, count), generator=generator)
        trajectory = torch.gather(chosen, 1, pick)
        lengths = torch.gather(self._steps, 1, trajectory)
        step = (torch.rand(strategies, count, generator=generator) * lengths).long()
        step = torch.minimum(step, lengths - 1)
        return gather(self.transitions, trajectory * self.horizon + step)


class Replay:
    """Generated transitions of past iterations, a ring per strategy, all rings in step.

    Parameters
    ----------
    capacity
        Transitions kept per strategy; the oldest give way.
    """

    def __init__(self, strategies: int, capacity: int, observation_width: int, action_width: int) -> None:
        width = 2 * observation_width + action_width + 2
        self.transitions = Transitions(
            torch.zeros(strategies, capacity, width), observation_width, action_width
        )
        self.capacity = capacity
        self.filled = 0
        self._next = 0

    def add(self, new: Transitions, keep: int, generator: torch.Generator) -> None:
        """Store `keep` random transitions of `new` per strategy."""
        strategies, available = new.packed.shape[:2]
        keep = min(keep, available, self.capacity)
        if keep == 0:
            return
        index = torch.rand(strategies, available, generator=generator).argsort(dim=1)[:, :keep]
        where = (self._next + torch.arange(keep)) % self.capacity
        self.transitions.packed[:, where] = gather(new, index).packed
        self._next = (self._next + keep) % self.capacity
        self.filled = min(self.filled + keep, self.capacity)

    def sample(self, count: int, generator: torch.Generator) -> Transitions:
        """Draw `count` transitions of each strategy, uniformly over what is stored."""
        shape = (self.transitions.packed.shape[0], count)
        return gather(self.transitions, torch.randint(self.filled, shape, generator=generator))

    def state_dict(self) -> dict[str, Any]:
        """Everything needed to go on exactly."""
        packed = self.transitions.packed[:, : self.filled].clone()
        return {"packed": packed, "next": self._next, "filled": self.filled}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up a state of `state_dict`."""
        self.filled, self._next = int(state["filled"]), int(state["next"])
        self.transitions.packed[:, : self.filled] = state["packed"]


def gather(transitions: Transitions, index: Tensor) -> Transitions:
    """Transitions at ``index [S, n]`` of each strategy."""
    rows = torch.arange(index.shape[0])[:, None]
    return Transitions(
        transitions.packed[rows, index], transitions.observation_width, transitions.action_width
    )


def of_others(
    batch: Transitions, count: int, generator: torch.Generator, reward_groups: Tensor | None = None
) -> Transitions:
    """For each strategy, `count` transitions drawn from the *other* strategies' rows of `batch`.

    Used for cross-negatives; a stored log-probability stays that of the strategy that made the transition.

    Parameters
    ----------
    reward_groups
        Whose strategy-only reward each strategy has, ``[S]``; who has the same is not another.
    """
    strategies, available = batch.packed.shape[:2]
    own = torch.arange(strategies)[:, None]
    step = torch.randint(1, max(strategies, 2), (strategies, count), generator=generator)
    index = torch.randint(available, (strategies, count), generator=generator)
    source = (own + step) % strategies
    if reward_groups is not None and count:
        strangers = (reward_groups[:, None] != reward_groups[None, :]).float()
        source = torch.multinomial(strangers, count, replacement=True, generator=generator)
    packed = batch.packed[source, index]
    return Transitions(packed, batch.observation_width, batch.action_width)
