"""Demonstrations, rollouts, and the transitions made of them.

Axes throughout: S strategies, M demonstrations or K rollouts of each, T steps of the horizon, T_act steps in
which the policy acts (T_act <= T; afterwards the arm holds and the world moves on), O observation columns,
A action columns. Transition t goes from observation t to observation t + 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.layout import Layout

if TYPE_CHECKING:
    from msrd_ros.learning.derived import DerivedColumns

NO_LABEL = ""
"""Label of demonstrations of which nobody has said whose they are."""


@dataclass(frozen=True)
class Demonstrations:
    """Expert trajectories of every strategy: the datasets D(1)..D(N) of the paper's Section 4.1.

    Attributes
    ----------
    observations
        ``[S, M, T+1, O]``; rows behind a trajectory's end are ignored.
    actions
        ``[S, M, T_act, A]``, in the policy's own units.
    layout
        Names of columns and strategies.
    lengths
        ``[S, M]`` valid steps of each trajectory, 0 where strategy i has fewer than M demonstrations;
        None means that every trajectory is whole.
    acting
        ``[S, M]`` steps in which the demonstrator acted; in the valid steps behind them an episode that has
        ended stays where it ended. None: in all T_act.
    derived
        What rewards may see beside the observed columns; None: nothing.
    """

    observations: NDArray[np.floating]
    actions: NDArray[np.floating]
    layout: Layout
    lengths: NDArray[np.integer] | None = None
    acting: NDArray[np.integer] | None = None
    derived: DerivedColumns | None = None

    def __post_init__(self) -> None:
        strategies, count, states, width = self.observations.shape
        if self.actions.shape[:2] != (strategies, count) or self.actions.shape[2] >= states:
            raise UserError(
                f"demonstrations: actions {self.actions.shape} do not go with observations "
                f"{self.observations.shape}; expected [strategies, demonstrations, steps, columns]"
            )
        names = (len(self.layout.observation_names), len(self.layout.action_names), len(self.layout.labels))
        if names != (width, self.actions.shape[3], strategies):
            raise UserError(
                f"demonstrations: {names[0]} observation names, {names[1]} action names and "
                f"{names[2]} labels "
                f"for {width} observation columns, {self.actions.shape[3]} action columns, "
                f"{strategies} strategies"
            )
        for index, label in enumerate(self.layout.labels):
            used = slice(None) if self.lengths is None else self.lengths[index] > 0
            if self.observations[index, used].shape[0] == 0:
                raise UserError(f"demonstrations: none for strategy {label!r}; record some or leave it out")
        if self.lengths is None and not (
            np.isfinite(self.observations).all() and np.isfinite(self.actions).all()
        ):
            raise UserError("demonstrations: an observation or action is not a finite number")

    @property
    def strategies(self) -> int:
        """Number of strategies, S."""
        return int(self.observations.shape[0])

    @property
    def horizon(self) -> int:
        """Steps of a trajectory, T."""
        return int(self.observations.shape[2]) - 1

    def step_counts(self) -> NDArray[np.int64]:
        """Valid steps of each trajectory, ``[S, M]``."""
        if self.lengths is not None:
            return np.asarray(self.lengths, dtype=np.int64)
        return np.full(self.observations.shape[:2], self.horizon, dtype=np.int64)

    def trajectories(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64], str]]:
        """Observations ``[T+1, O]``, actions ``[T, A]`` and label of each, strategy by strategy.

        Only the steps in which the demonstrator acted.
        """
        counts = self.step_counts()
        acted = np.minimum(counts if self.acting is None else self.acting, self.actions.shape[2])
        return [
            (
                self.observations[row, column, : steps + 1].astype(np.float64),
                self.actions[row, column, :steps].astype(np.float64),
                self.layout.labels[row],
            )
            for row, column in np.argwhere(counts > 0)
            for steps in [int(min(acted[row, column], counts[row, column]))]
        ]

    def relabelled(self, labels: Sequence[str]) -> Demonstrations:
        """The same trajectories with other labels, one each in the order of `trajectories`.

        Raises
        ------
        UserError
            If there are not as many labels as trajectories.
        """
        places = np.argwhere(self.step_counts() > 0)
        if len(labels) != len(places):
            raise UserError(f"labels: {len(labels)} for {len(places)} demonstrations; give one each")
        names = tuple(dict.fromkeys(labels))
        rows = [
            [place for place, label in zip(places, labels, strict=True) if label == name] for name in names
        ]
        shape = len(names), max(map(len, rows))
        observations = np.zeros((*shape, *self.observations.shape[2:]))
        actions = np.zeros((*shape, *self.actions.shape[2:]))
        lengths, acting = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
        counts = self.step_counts()
        acted = np.full(counts.shape, self.actions.shape[2]) if self.acting is None else self.acting
        for row, group in enumerate(rows):
            for column, (old_row, old_column) in enumerate(group):
                old = int(old_row), int(old_column)
                observations[row, column], actions[row, column] = self.observations[old], self.actions[old]
                lengths[row, column], acting[row, column] = counts[old], acted[old]
        return Demonstrations(
            observations,
            actions,
            replace(self.layout, labels=names),
            lengths,
            None if self.acting is None else acting,
            self.derived,
        )

    def pooled(self, label: str = "all") -> Demonstrations:
        """The same demonstrations as if of one strategy, for a single-reward baseline."""
        merge = (1, -1)
        return Demonstrations(
            self.observations.reshape(*merge, *self.observations.shape[2:]),
            self.actions.reshape(*merge, *self.actions.shape[2:]),
            Layout(
                self.layout.observation_names,
                self.layout.action_names,
                (label,),
                self.layout.control_period_s,
            ),
            None if self.lengths is None else self.lengths.reshape(1, -1),
            None if self.acting is None else self.acting.reshape(1, -1),
            self.derived,
        )


@dataclass(frozen=True)
class Rollouts:
    """Trajectories generated by the current policies.

    Attributes
    ----------
    observations
        ``[S, K, T+1, O]``.
    actions
        ``[S, K, T_act, A]`` as drawn from the policy, before any clipping by the environment.
    log_probs
        ``[S, K, T_act]``, log pi_i(a|s) under the policies that drew them.
    acting
        ``[S, K]`` steps in which a policy acted; None: all T_act. Behind them an episode that has ended stays
        where it ended.
    lengths
        ``[S, K]`` valid steps; rows behind them (of an episode that was cut off) are ignored. None: all T.
    environment_reward
        ``[S, K, T]``, what the environment itself paid, 0 where nobody acted; None: it pays nothing.
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    log_probs: NDArray[np.float32]
    acting: NDArray[np.int64] | None = None
    lengths: NDArray[np.int64] | None = None
    environment_reward: NDArray[np.float32] | None = None

    @property
    def played_steps(self) -> int:
        """Steps that were played, all episodes together."""
        if self.acting is None:
            return int(self.observations[:, :, 1:, 0].size)
        return int(self.acting.sum())


class Transitions:
    """Transitions of every strategy, packed so that sampling is one gather.

    Parameters
    ----------
    packed
        ``[S, N, O + A + O + 2]``: observation, action, next observation, passive (1 where no policy acted),
        log-probability of the action at the time it was drawn.
    observation_width, action_width
        O and A.
    """

    def __init__(self, packed: Tensor, observation_width: int, action_width: int) -> None:
        self.packed = packed
        self.observation_width = observation_width
        self.action_width = action_width

    @property
    def observation(self) -> Tensor:
        """``[S, N, O]``."""
        return self.packed[..., : self.observation_width]

    @property
    def action(self) -> Tensor:
        """``[S, N, A]``, zero where passive."""
        return self.packed[..., self.observation_width : self.observation_width + self.action_width]

    @property
    def next_observation(self) -> Tensor:
        """``[S, N, O]``."""
        start = self.observation_width + self.action_width
        return self.packed[..., start : start + self.observation_width]

    @property
    def passive(self) -> Tensor:
        """``[S, N]``, 1 where no policy acted."""
        return self.packed[..., -2]

    @property
    def log_prob(self) -> Tensor:
        """``[S, N]``, as stored when the transition was made."""
        return self.packed[..., -1]

    def with_log_prob(self, log_prob: Tensor) -> Transitions:
        """The same transitions with other stored log-probabilities ``[S, N]``."""
        packed = torch.cat([self.packed[..., :-1], log_prob.unsqueeze(-1)], dim=-1)
        return Transitions(packed, self.observation_width, self.action_width)

    def steps(self, start: int, count: int) -> Transitions:
        """Transitions ``start .. start + count - 1`` along the sample axis, a view."""
        return Transitions(self.packed[:, start : start + count], self.observation_width, self.action_width)

    @staticmethod
    def join(parts: list[Transitions]) -> Transitions:
        """Concatenate along the sample axis."""
        packed = torch.cat([part.packed for part in parts], dim=1)
        return Transitions(packed, parts[0].observation_width, parts[0].action_width)

    @staticmethod
    def of(
        observations: Tensor,
        actions: Tensor,
        log_probs: Tensor | None = None,
        acting_steps: NDArray[np.integer] | None = None,
    ) -> Transitions:
        """Flatten trajectories ``[S, K, T+1, O]`` and ``[S, K, T_act, A]`` to ``[S, K*T, ...]``.

        Parameters
        ----------
        acting_steps
            ``[S, K]``, how long somebody acts in each trajectory; None: T_act steps.
        """
        strategies, count, states, width = observations.shape
        acting, action_width = actions.shape[2], actions.shape[3]
        packed = torch.zeros(strategies, count, states - 1, 2 * width + action_width + 2)
        packed[..., :width] = observations[:, :, :-1]
        packed[:, :, :acting, width : width + action_width] = actions
        packed[..., width + action_width : 2 * width + action_width] = observations[:, :, 1:]
        packed[:, :, acting:, -2] = 1.0
        if log_probs is not None:
            packed[:, :, :acting, -1] = log_probs
        if acting_steps is not None:
            over = torch.arange(states - 1) >= torch.as_tensor(acting_steps)[..., None]
            packed[..., width : width + action_width][over] = 0.0
            packed[..., -2][over], packed[..., -1][over] = 1.0, 0.0
        return Transitions(packed.flatten(1, 2), width, action_width)
