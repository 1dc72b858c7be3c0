"""What a method infers, as functions of states: a task reward, strategy rewards, or both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from msrd_ros.learning.baselines import StrategyClassifier, SupervisedRewards
from msrd_ros.learning.rewards import RewardEnsemble, RewardForm, RewardValues
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.studies.shared.task import LearningTask, VirtualTask

Rewards = Callable[[Tensor], Tensor]
"""Rewards of states. A task reward maps ``[..., O]`` to ``[...]``. Rewards of strategies map ``[N, O]`` to
every strategy's ``[S, N]``, and ``[S, N, O]`` to what strategy i says of row i, ``[S, N]``."""


@dataclass(frozen=True)
class Estimate:
    """What a method inferred.

    Attributes
    ----------
    task
        R0; None if the method claims none.
    strategies
        Strategy-only rewards; None if the method claims none.
    combined
        R_i (a single reward gives one row); None if there is none.
    weights
        The numbers behind the functions, to keep.
    seconds, environment_steps
        What it took.
    members
        The estimates of single runs, if this is the mean of several.
    """

    task: Rewards | None
    strategies: Rewards | None
    combined: Rewards | None
    weights: dict[str, Tensor]
    seconds: float
    environment_steps: int
    members: tuple[Estimate, ...] = ()

    def tensors(self) -> dict[str, Tensor]:
        """Weights and cost, for a file."""
        cost = torch.tensor([self.seconds, float(self.environment_steps)], dtype=torch.float64)
        return {"cost": cost, **{name: value.contiguous() for name, value in self.weights.items()}}


def from_rewards(
    task: LearningTask, rewards: RewardEnsemble, seconds: float, environment_steps: int
) -> Estimate:
    """The functions of states that trained reward models stand for.

    AIRL per strategy has no task reward of its own; the mean of its rewards is the natural guess at one, and
    its rewards as they are stand for the strategies', as in the paper.
    """

    def values(states: Tensor) -> RewardValues:
        width, actions = task.observation_width, task.action_width
        packed = torch.zeros(*states.shape[:-1], 2 * width + actions + 2)
        packed[..., width + actions : 2 * width + actions] = states
        rows = packed if packed.dim() == 3 else packed.expand(rewards.strategies, -1, -1)
        values: RewardValues = rewards(Transitions(rows, width, actions))
        return values

    def mean_reward(states: Tensor) -> Tensor:
        flat = states.reshape(-1, states.shape[-1])
        return values(flat).combined.mean(dim=0).reshape(states.shape[:-1])

    members: tuple[Estimate, ...] = ()
    if len(rewards) > 1:
        share = 1.0 / len(rewards)
        members = tuple(
            from_rewards(task, RewardEnsemble([model]), share * seconds, round(share * environment_steps))
            for model in rewards.members
        )
    return Estimate(
        mean_reward if rewards.form is RewardForm.STRATEGY_ONLY else rewards.task,
        None if rewards.form is RewardForm.TASK_ONLY else lambda states: values(states).strategy,
        lambda states: values(states).combined,
        dict(rewards.state_dict()),
        seconds,
        environment_steps,
        members,
    )


def by_row(table: Rewards) -> Rewards:
    """Let a function that only judges ``[N, O]`` by every strategy judge ``[S, N, O]`` row by row as well."""

    def rewards(states: Tensor) -> Tensor:
        if states.dim() == 2:
            return table(states)
        everything = table(states.flatten(0, 1)).unflatten(1, states.shape[:2])
        own: Tensor = everything.diagonal(dim1=0, dim2=1).T
        return own

    return rewards


def from_classifier(classifier: StrategyClassifier, seconds: float) -> Estimate:
    """Log q(i|s) as the strategy reward."""
    weights = dict(classifier.network.state_dict())
    return Estimate(None, by_row(classifier.log_posterior), None, weights, seconds, 0)


def from_teaching(supervised: SupervisedRewards, seconds: float) -> Estimate:
    """What a regression on the truth says of the strategies."""
    weights = {**supervised.network.state_dict(), "bounds": supervised.bounds}
    return Estimate(None, by_row(supervised.table), None, weights, seconds, 0)


def from_places(task: VirtualTask, places: Tensor, seconds: float) -> Estimate:
    """A guess that knows the answer's form: minus the distance to where the strategy's column settles."""

    def strategies(states: Tensor) -> Tensor:
        return -(states[..., task.identifying_feature] - places[:, None]).abs()

    return Estimate(None, strategies, None, {"places": places}, seconds, 0)
