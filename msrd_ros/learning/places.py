"""What `train` plays in: whatever a user has, held against the demonstrations first."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.environment import GymCollector, GymEnvironment
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rollouts import BatchedCollector, Collector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts

FAR = 6.0
"""Standard deviations between the states in which demonstrations and the environment's episodes begin."""
TRIAL_EPISODES = 8


@dataclass(frozen=True)
class Place:
    """Where policies are played.

    Attributes
    ----------
    collector, autoreset
        As of `Problem`.
    scale
        How the environment's actions follow from the policies'; None: they are the same.
    curve
        Mean return of the environment's own reward, ``[S]`` for each time it was played; empty where it pays
        nothing.
    """

    collector: Collector
    autoreset: Collector | None = None
    scale: ActionScale | None = None
    curve: list[list[float]] = field(default_factory=list)


class Noted:
    """Notes what the environment itself paid.

    Parameters
    ----------
    collector
        Where policies are really played.
    curve
        Gets a list of mean returns, one per policy, for each time.
    """

    def __init__(self, collector: Collector, curve: list[list[float]]) -> None:
        self._collector = collector
        self._curve = curve

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        """As the collector does."""
        played = self._collector.collect(policies, episodes, rng)
        if played.environment_reward is not None:
            self._curve.append(played.environment_reward.sum(axis=-1).mean(axis=-1).tolist())
        return played


def find_place(environment: Any, demonstrations: Demonstrations) -> Place:
    """Make a place to play of whatever `train` takes.

    Raises
    ------
    UserError
        If it is none of these, or its columns are not those of the demonstrations.
    """
    if hasattr(environment, "collect"):
        curve: list[list[float]] = []
        return Place(Noted(environment, curve), curve=curve)
    if not isinstance(environment, GymEnvironment):
        if hasattr(environment, "acting_steps") and hasattr(environment, "reset"):
            names = tuple(environment.observation_names), tuple(environment.action_names)
            _require_columns(demonstrations.layout, *names)
            return Place(BatchedCollector(environment))
        if not (
            isinstance(environment, str) or callable(environment) or hasattr(environment, "action_space")
        ):
            raise UserError(
                f"environment: {type(environment).__name__} is none; give the id of a Gymnasium environment, "
                "an environment or a function that makes one"
            )
        environment = GymEnvironment(environment, demonstrations.horizon)
    return _gym_place(environment, demonstrations)


def _gym_place(environment: GymEnvironment, demonstrations: Demonstrations) -> Place:
    layout = demonstrations.layout
    named_observations, named_actions = environment.named
    names = environment.observation_names, environment.action_names
    for kind, named, found, wanted in (
        ("observation", named_observations, names[0], layout.observation_names),
        ("action", named_actions, names[1], layout.action_names),
    ):
        if not named and len(found) != len(wanted):
            raise UserError(
                f"environment: {len(found)} {kind} columns ({', '.join(found)}), the demonstrations have "
                f"{len(wanted)} ({', '.join(wanted)})"
            )
    _require_columns(
        layout,
        names[0] if named_observations else layout.observation_names,
        names[1] if named_actions else layout.action_names,
    )
    _warn_of_other_starts(environment, demonstrations)
    acted = demonstrations.actions[_acted(demonstrations)]
    low, high = environment.action_bounds
    _warn_of_bounds(layout, acted, low, high)
    scale = ActionScale.of(low, high, acted)
    again = GymCollector(environment.copy(autoreset=True, scale=scale))
    curve: list[list[float]] = []
    return Place(Noted(GymCollector(environment.copy(scale=scale)), curve), again, scale, curve)


def _require_columns(
    layout: Layout, observation_names: tuple[str, ...], action_names: tuple[str, ...]
) -> None:
    found = Layout(observation_names, action_names, layout.labels, layout.control_period_s)
    found.require(layout, "environment")


def _acted(demonstrations: Demonstrations) -> NDArray[np.bool_]:
    """Which ``[S, M, T_act]`` are demonstrated actions."""
    steps = np.arange(demonstrations.actions.shape[2])
    counts = demonstrations.step_counts() if demonstrations.acting is None else demonstrations.acting
    return np.asarray(steps < counts[..., None])


def _warn_of_other_starts(environment: GymEnvironment, demonstrations: Demonstrations) -> None:
    trial = environment.copy()
    begun = trial.reset(1, TRIAL_EPISODES, np.random.default_rng(0))[0].astype(np.float64)
    trial.close()
    used = demonstrations.step_counts() > 0
    shown = demonstrations.observations[used]
    first = shown[:, 0]
    least = 0.05 * shown.reshape(-1, shown.shape[-1]).std(axis=0) + 1e-6
    spread = first.std(axis=0) + begun.std(axis=0) + least
    far = np.abs(first.mean(axis=0) - begun.mean(axis=0)) > FAR * spread
    for column in np.flatnonzero(far):
        warnings.warn(
            f"column {demonstrations.layout.observation_names[column]!r} begins at "
            f"{first[:, column].mean():.3g} in the demonstrations and at {begun[:, column].mean():.3g} in "
            "the environment: are the columns in another order or unit, or is it another task?",
            stacklevel=5,
        )


def _warn_of_bounds(
    layout: Layout, acted: NDArray[np.floating], low: NDArray[np.float64], high: NDArray[np.float64]
) -> None:
    room = 1e-3 * np.where(np.isfinite(high - low), high - low, 0.0)
    beyond = ((acted < low - room) | (acted > high + room)).any(axis=0)
    for column in np.flatnonzero(beyond):
        reach = acted[np.abs(acted[:, column]).argmax(), column]
        warnings.warn(
            f"action {layout.action_names[column]!r} reaches {reach:.3g} in the demonstrations; the "
            f"environment clips it to {low[column]:.3g} .. {high[column]:.3g}: is it in another unit?",
            stacklevel=5,
        )
