"""What a method infers, as functions of states: a task reward, strategy rewards, or both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from msrd_ros.experiments.virtual_studies.task import VirtualTask
from msrd_ros.learning.baselines import StrategyClassifier
from msrd_ros.learning.rewards import RewardEnsemble, RewardForm, RewardValues
from msrd_ros.learning.trajectories import Transitions

Rewards = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class Estimate:
    """What a method inferred.

    Attributes
    ----------
    task
        Maps states ``[N, O]`` to R0 ``[N]``; None if the method claims none.
    strategies
        Maps states ``[N, O]`` to the strategy-only rewards ``[S, N]``; None if the method claims none.
    combined
        Maps states ``[N, O]`` to R_i ``[S, N]`` (``[1, N]`` for a single reward); None if there is none.
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
    task: VirtualTask, rewards: RewardEnsemble, seconds: float, environment_steps: int
) -> Estimate:
    """The functions of states that trained reward models stand for.

    AIRL per strategy has no task reward of its own; the mean of its rewards is the natural guess at one, and
    its rewards as they are stand for the strategies', as in the paper.
    """

    def values(states: Tensor) -> RewardValues:
        width, actions = task.observation_width, task.action_width
        packed = torch.zeros(1, states.shape[0], 2 * width + actions + 2)
        packed[0, :, width + actions : 2 * width + actions] = states
        return rewards.table(Transitions(packed, width, actions))

    def mean_reward(states: Tensor) -> Tensor:
        return values(states).combined.mean(dim=0)

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


def from_classifier(classifier: StrategyClassifier, seconds: float) -> Estimate:
    """log q(i|s) as the strategy reward."""
    weights = dict(classifier.network.state_dict())
    return Estimate(None, classifier.log_posterior, None, weights, seconds, 0)


def from_places(task: VirtualTask, places: Tensor, seconds: float) -> Estimate:
    """A guess that knows the answer's form: minus the distance to where the strategy's column settles."""

    def strategies(states: Tensor) -> Tensor:
        return -(states[None, :, task.telling_column] - places[:, None]).abs()

    return Estimate(None, strategies, None, {"places": places}, seconds, 0)
