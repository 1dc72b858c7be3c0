"""Policies improved on rewards that stay as they are: learned elsewhere, or paid by the environment."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import torch
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method, Problem
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.rewards import RewardModel
from msrd_ros.learning.trajectories import Rollouts, Transitions

REFERENCE_PRICE = 1.0
"""Without any a stroke that had reached 97 % fell to 44 in 60 iterations, at .2 to 82 in 45: a reward that no
discriminator corrects any more is followed to where it was never told anything. Chosen on another population,
as are the steps of refitting."""


class FrozenRewardTraining(MSRD):
    """Clones as MSRD does, then improves the policies on rewards that it was given: lines 6, 9 and 10.

    Parameters
    ----------
    problem
        What every method is given. What is demonstrated is cloned, and the rewards learn nothing of it.
    rewards
        R0 and S_i, of strategies in the same order; columns go by their names, so that they may have been
        learned on another robot. None: load some into ``averaged_rewards``.

    Raises
    ------
    UserError
        If the rewards are of another number of strategies, or see a column that is not there.
    """

    def __init__(self, problem: Problem, rewards: RewardModel | None = None) -> None:
        super().__init__(problem.config, problem.demonstrations, problem.collector, problem.seed)
        if rewards is not None:
            strategies = problem.demonstrations.strategies
            if rewards.strategies != strategies:
                raise UserError(f"frozen rewards of {rewards.strategies} strategies, for {strategies}")
            names = self.layout.observation_names
            self._averaged.model = rewards.on(names, problem.demonstrations.derived)

    def iterate(self) -> dict[str, float]:
        """Play, reward, improve."""
        rollouts = self._collect(self.config.episodes, self._collector)
        transitions = self._transitions(rollouts)
        with torch.no_grad():
            paid = self._paid(rollouts, transitions)
            reward = self._reference.charge(paid, transitions, self.policies)
        reward = reward.reshape(*rollouts.actions.shape[:2], -1)
        metrics = self._improvement.improve(rollouts, reward, self.progress)
        self.iterations_done += 1
        return metrics | {"reward": float(reward.mean()), "environment_steps": float(self.environment_steps)}

    def _paid(self, rollouts: Rollouts, transitions: Transitions) -> Tensor:
        """Line 9: ``[S, N]``."""
        paid: Tensor = self.averaged_rewards(transitions).combined
        return paid


class EnvironmentRewardTraining(FrozenRewardTraining):
    """The same on what the environment itself pays (`Rollouts.environment_reward`): a ceiling."""

    def _paid(self, rollouts: Rollouts, transitions: Transitions) -> Tensor:
        if rollouts.environment_reward is None:
            raise UserError("environment reward: this environment pays nothing")
        return torch.as_tensor(rollouts.environment_reward).flatten(1)


class FrozenReward(Method):
    """Cloning, then TRPO on rewards of another run that nobody corrects any more.

    Parameters
    ----------
    rewards
        Those of the run; None: they are loaded into the learner later.
    price
        Of a nat away from the clones; 0 where nothing was cloned.
    """

    name = "frozen_reward"
    title = "frozen R0 + S_i"
    has_rewards = False
    training: ClassVar[type[FrozenRewardTraining]] = FrozenRewardTraining

    def __init__(self, rewards: RewardModel | None = None, price: float = REFERENCE_PRICE) -> None:
        self._rewards, self._price = rewards, price

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """A price on leaving the clones."""
        return replace(config, policy=replace(config.policy, reference_price=self._price))

    def start(self, problem: Problem) -> FrozenRewardTraining:
        """The run before its first step."""
        config = self.configure(problem.config, problem.demonstrations.strategies)
        return self.training(replace(problem, config=config), self._rewards)


class EnvironmentReward(FrozenReward):
    """The same on what the environment pays."""

    name = "environment_reward"
    title = "the true reward"
    training = EnvironmentRewardTraining
