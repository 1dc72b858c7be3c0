"""Episodes of different lengths: what lies behind their ends, and what does not count there.

An episode that ends (the environment says `terminated`) stays where it ended, with nobody acting, until the
horizon: so every trajectory is as long as every other, and a learned reward says what being there is worth.
Without, a reward above zero would want long episodes and one below zero short ones, whatever is demonstrated.
An episode that is cut off (`truncated`, or the horizon) would have gone on: its last state has a value.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.trajectories import Rollouts, Transitions


def filled_rows(lengths: NDArray[np.integer], horizon: int) -> Tensor:
    """The first ``lengths [S, K]`` steps of all trajectories of each strategy, as rows ``[S, N]`` of K * T.

    N is the number of the strategy that has most; the others' begin again until they have as many.
    """
    counts = torch.as_tensor(np.asarray(lengths, dtype=np.int64))
    inside = (torch.arange(horizon) < counts[..., None]).flatten(1)
    order = torch.argsort((~inside).to(torch.int8), dim=1, stable=True)
    numbers = inside.sum(dim=1)
    return torch.gather(order, 1, torch.arange(int(numbers.max())) % numbers[:, None])


def only_valid(transitions: Transitions, lengths: NDArray[np.integer] | None) -> Transitions:
    """Transitions ``[S, K * T]`` with those behind the ``lengths [S, K]`` replaced by valid ones."""
    if lengths is None:
        return transitions
    strategies, total = transitions.packed.shape[:2]
    rows = filled_rows(lengths, total // lengths.shape[1])
    rows = rows[:, torch.arange(total) % rows.shape[1]]
    packed = transitions.packed[torch.arange(strategies)[:, None], rows]
    return Transitions(packed, transitions.observation_width, transitions.action_width)


def acting_rows(rollouts: Rollouts) -> Callable[[Tensor], Tensor]:
    """Chooses the rows of ``[S, K * T_act, ...]`` in which a policy acted, ``[S, N, ...]``."""
    if rollouts.acting is None:
        return lambda values: values
    rows = filled_rows(rollouts.acting, rollouts.actions.shape[2])
    strategies = torch.arange(len(rows))[:, None]
    return lambda values: values[strategies, rows]


def hold_endings(
    rollouts: Rollouts, reward: Tensor, values: Tensor, discount: float, goes_on: bool
) -> tuple[Tensor, Tensor]:
    """Rewards ``[S, K, T]`` and values ``[S, K, T + 1]`` that are right behind the episodes' ends as well.

    Where an episode has ended, every further step pays what the first one pays, r: the state is worth
    ``r (1 - gamma^m) / (1 - gamma)`` with m steps to go, without end if it `goes_on` behind the horizon.
    Where it was cut off, the value v of the last valid state is kept, by a reward of ``(1 - gamma) v``.
    Either way the temporal differences behind the end are zero, so that nothing leaks into the advantages.
    """
    if rollouts.acting is None:
        return reward, values
    horizon = reward.shape[-1]
    last = torch.as_tensor(rollouts.acting)[..., None]
    valid = horizon if rollouts.lengths is None else torch.as_tensor(rollouts.lengths)[..., None]
    cut = last >= valid
    steps = torch.arange(horizon + 1)
    remaining = torch.full((horizon + 1,), torch.inf) if goes_on else (horizon - steps).float()
    weights = (1.0 - discount**remaining) / (1.0 - discount) if discount < 1.0 else remaining
    paid = torch.gather(reward, -1, last.clamp(max=horizon - 1))
    kept = torch.gather(values, -1, last)
    values = torch.where(steps >= last, torch.where(cut, kept, paid * weights), values)
    paid = torch.where(cut, (1.0 - discount) * kept, paid)
    return torch.where(steps[:-1] >= last, paid, reward), values


def require_usable(rollouts: Rollouts, layout: Layout) -> None:
    """Refuse rollouts of other columns or with numbers that are not finite, before anything learns from them.

    Raises
    ------
    UserError
        Naming the column, the strategy and the step.
    """
    found: list[tuple[int, str]] = []
    for kind, names, values in (
        ("observation", layout.observation_names, rollouts.observations),
        ("action", layout.action_names, rollouts.actions),
    ):
        if values.shape[-1] != len(names):
            raise UserError(f"rollouts: {values.shape[-1]} {kind} columns instead of {', '.join(names)}")
        bad = ~np.isfinite(values)
        if bad.any():
            places = np.argwhere(bad)
            strategy, episode, step, column = (int(n) for n in places[places[:, 2].argmin()])
            value = values[strategy, episode, step, column]
            text = (
                f"rollout of strategy {layout.labels[strategy]!r}, episode {episode}, step {step}: {kind} "
                f"{names[column]!r} is {value}{_history(kind, rollouts, strategy, episode, step)}"
            )
            found.append((step, text))
    if found:
        # Whichever came first: an observation that is no number makes the action so, and the other way round.
        raise UserError(min(found, key=lambda item: item[0])[1])


def _history(kind: str, rollouts: Rollouts, strategy: int, episode: int, step: int) -> str:
    """What came before, and what to do."""
    if kind == "action":
        return "; training diverged: lower trust_region.kl or discriminator.learning_rate"
    if step == 0:
        return "; mend the environment's reset"
    with np.printoptions(precision=4, threshold=64, linewidth=10_000):
        before = rollouts.observations[strategy, episode, step - 1]
        action = rollouts.actions[strategy, episode, min(step, rollouts.actions.shape[2]) - 1]
        return f" after observation {before} and action {action}; mend the environment"
