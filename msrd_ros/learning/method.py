"""What a method of learning from demonstrations is: the one interface of all of them.

A method is a class in a file of its own under `methods` and an entry in `methods.METHODS`. Whoever trains
calls three things::

    learner = find_method("msrd").start(Problem(config, demonstrations, collector, seed))
    learner.clone()
    for _ in range(learner.config.iterations):
        learner.iterate()

and reads `Learner.policies` and `Learner.averaged_rewards`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rewards import RewardModel
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations


@dataclass(frozen=True)
class Problem:
    """Everything that a method is given.

    Attributes
    ----------
    config
        The recipe; a method changes what its name says and nothing else (`Method.configure`).
    demonstrations
        D(1)..D(N).
    collector
        Where policies are played.
    seed
        Everything random follows from it.
    policies
        Initial policies; None: Gaussian ones by `config`.
    autoreset
        As `collector`, but episodes start again whenever the task is lost; needed for
        ``config.cloning.restarts`` alone.
    """

    config: MSRDConfig
    demonstrations: Demonstrations
    collector: Collector
    seed: int
    policies: Policies | None = None
    autoreset: Collector | None = None


class Learner(Protocol):
    """A run of a method under way; `MSRD` is one.

    Attributes
    ----------
    config
        Settings as the method has changed them; ``config.iterations`` iterations are planned.
    layout
        Names of observations, actions and strategies.
    policies
        One policy for each row of the method's demonstrations.
    iterations_done, environment_steps
        How far it has come.
    """

    config: MSRDConfig
    layout: Layout
    policies: Policies
    iterations_done: int
    environment_steps: int

    @property
    def averaged_rewards(self) -> RewardModel:
        """The rewards to report."""
        ...

    def clone(self) -> dict[str, float]:
        """What comes before the first iteration; figures by name."""
        ...

    def iterate(self) -> dict[str, float]:
        """One round of playing and learning; figures by name."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Everything needed to go on exactly: numbers, text, tensors, and lists and dictionaries of them."""
        ...

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up a state of `state_dict`."""
        ...


class Method:
    """A way to learn rewards and policies; by itself it changes nothing, and so is MSRD with its recipe.

    Most methods are Algorithm 1 with another reward or other terms and override `configure` alone; one that
    is not overrides `start`.

    Attributes
    ----------
    name
        As in ``train(method=NAME)`` and in the names of files.
    title
        As tables and figures call it.
    has_rewards
        Whether its rewards mean anything; which of R0 and S_i there are, their form says.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    has_rewards: ClassVar[bool] = True

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """The recipe with this method's own changes, for so many strategies."""
        return config

    def arrange(self, demonstrations: Demonstrations) -> Demonstrations:
        """The demonstrations as the method sees them, one row for each policy that it trains."""
        return demonstrations

    def start(self, problem: Problem) -> Learner:
        """A run of the method, before its first step."""
        demonstrations = problem.demonstrations
        return MSRD(
            self.configure(problem.config, demonstrations.strategies),
            self.arrange(demonstrations),
            problem.collector,
            problem.seed,
            problem.policies,
            problem.autoreset,
        )
