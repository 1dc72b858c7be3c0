"""A simulated task and its demonstrators, as much of them as methods and marks need to know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations

Observations = NDArray[np.floating]


class StrategyTruth(Protocol):
    """True strategy-only rewards."""

    def table(self, states: Tensor) -> Tensor:
        """Every strategy's true preference for ``states [N, O]``, ``[S, N]``."""
        ...


class DemonstrationSource(Protocol):
    """Where the demonstrations of a study come from: demonstrators, or a file of what others recorded."""

    @property
    def recipe(self) -> Any:
        """How they were made: a dataclass, part of the key under which runs are kept."""
        ...

    @property
    def truth(self) -> StrategyTruth | None:
        """True strategy rewards; None where nobody knows them."""
        ...

    @property
    def report(self) -> dict[str, Any]:
        """What is to be said about them, as data for JSON."""
        ...

    def demonstrate(self, count: int, seed: int) -> Demonstrations:
        """`count` episodes of each strategy."""
        ...


class Demonstrators(DemonstrationSource, Protocol):
    """Policies that solve a task, each in its own way, and what each of them truly prefers."""

    @property
    def policies(self) -> GaussianPolicies:
        """One policy per strategy."""
        ...

    @property
    def truth(self) -> StrategyTruth:
        """Their true strategy rewards."""
        ...


class CollectorMaker(Protocol):
    """Makes the place where policies are played."""

    def __call__(self, horizon: int, random_actions: float | NDArray[np.float64] = 0.0) -> Collector:
        """Episodes of `horizon` steps; actions are replaced by random ones with the given probability.

        Parameters
        ----------
        horizon
            Steps of an episode.
        random_actions
            One probability for all, or ``[S, K]``: the noise injection of Brown et al. (2019) that makes
            trajectories of various quality.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class LearningTask:
    """A task as the methods see it.

    Attributes
    ----------
    name
        As in ``reproduce NAME``.
    observation_width, action_width
        O and A.
    features
        How networks see an observation.
    preset
        Settings of MSRD on this task; those of the other methods follow from them.
    make_collector
        Where policies are played, in episodes of so many steps.
    horizon
        Steps of a full episode, T.
    make_autoreset
        Where episodes of so many steps start again whenever the task is lost; None: nowhere.
    own_presets
        By a method's name: settings tuned for it alone; without, those of `preset`. Of those for the paper's
        loss and for AIRL per strategy `as_printed` then takes whatever the paper does not have.
    """

    name: str
    observation_width: int
    action_width: int
    features: Features
    preset: Callable[[], MSRDConfig]
    make_collector: Callable[[int], Collector]
    horizon: int
    make_autoreset: Callable[[int], Collector] | None = None
    own_presets: Mapping[str, Callable[[], MSRDConfig]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class VirtualTask(LearningTask):
    """One simulated task with demonstrators of our own and a truth about every state.

    Attributes
    ----------
    make_collector
        Where policies are played; can disturb their actions.
    task_reward
        True task reward of states ``[..., O]``, ``[...]``.
    has_fallen
        Whether the task was ever lost in trajectories ``[..., T+1, O]``, ``[...]``.
    noise_levels
        Probabilities of random actions for test trajectories; beyond the last all are alike.
    identifying_feature
        Column of the observation whose settled mean tells the strategies apart, for the oracle.
    """

    make_collector: CollectorMaker
    task_reward: Callable[[Observations], NDArray[np.float64]]
    has_fallen: Callable[[Observations], NDArray[np.bool_]]
    noise_levels: tuple[float, ...]
    identifying_feature: int
