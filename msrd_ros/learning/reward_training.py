"""Algorithm 1, line 8: stepping R0 and S_i on the discriminator's loss."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from msrd_ros.learning.config import DiscriminatorConfig, ReplayConfig, TaskUpdate
from msrd_ros.learning.discriminator import (
    cross_negative_loss,
    discriminator_logit,
    distillation_loss,
    gradient_penalty,
)
from msrd_ros.learning.displaced import Displacement
from msrd_ros.learning.replay import Replay, gather, of_others
from msrd_ros.learning.rewards import AveragedRewards, RewardForm, RewardModel
from msrd_ros.learning.trajectories import Transitions


@dataclass(frozen=True)
class Negatives:
    """Generated transitions ``[S, N]`` with the log-density they were made with, in random order."""

    transitions: Transitions

    @classmethod
    def draw(
        cls,
        latest: Transitions,
        replay: Replay,
        snapshots: Transitions | None,
        displacement: Displacement,
        config: ReplayConfig,
        amount: int,
        generator: torch.Generator,
    ) -> Negatives:
        """Mix the sources by their shares; an empty source leaves its share to the latest rollouts."""
        strategies = latest.packed.shape[0]
        replayed = round(config.replay_share * amount) if replay.filled else 0
        from_snapshots = round(config.snapshot_share * amount) if snapshots is not None else 0

        def pick(source: Transitions, count: int) -> Transitions:
            shape = (strategies, count)
            return gather(source, torch.randint(source.packed.shape[1], shape, generator=generator))

        parts = [pick(latest, amount - replayed - from_snapshots)]
        if replayed:
            parts.append(replay.sample(replayed, generator))
        if snapshots is not None and from_snapshots:
            parts.append(pick(snapshots, from_snapshots))
        mixed = Transitions.join(parts)
        order = torch.randperm(mixed.packed.shape[1], generator=generator)
        drawn = Transitions(mixed.packed[:, order], mixed.observation_width, mixed.action_width)
        return cls(displacement.displace(drawn, config.displaced_share, generator))


def used_log_prob(log_prob: Tensor, log_std: Tensor | None, config: DiscriminatorConfig) -> Tensor:
    """Log-densities of actions as the discriminator uses them, of the same shape; see `DiscriminatorConfig`.

    Parameters
    ----------
    log_prob
        Of any shape.
    log_std
        ``[..., A]`` of the Gaussian policies, for ``centre_log_prob`` alone.

    Raises
    ------
    TypeError
        If log-densities are to be centred and it is None.
    """
    if not config.uses_log_prob:
        return torch.zeros_like(log_prob)
    if config.centre_log_prob:
        if log_std is None:
            raise TypeError("centre_log_prob needs Gaussian policies")
        log_prob = log_prob + (log_std + 0.5 * math.log(2.0 * math.pi * math.e)).sum(dim=-1)
    return log_prob.clamp(*config.log_prob_bounds)


class RewardTraining:
    """Adam on the rewards; one step is one application of Equation 7 to fresh samples.

    Parameters
    ----------
    rewards
        The model to train.
    averaged
        Its moving average, updated after every step.
    config
        Settings.
    iterations
        Planned iterations, for the learning-rate schedule.
    """

    def __init__(
        self, rewards: RewardModel, averaged: AveragedRewards, config: DiscriminatorConfig, iterations: int
    ) -> None:
        self._rewards = rewards
        self._averaged = averaged
        self._config = config
        self._iterations = iterations
        task = list(rewards.task_parameters())
        own = list(rewards.strategy_network.parameters())
        if rewards.potential_network is not None:
            own += list(rewards.potential_network.parameters())
        rate, decay = config.learning_rate, config.weight_decay
        self._task_optimiser = torch.optim.Adam(task, lr=rate, weight_decay=decay, foreach=True)
        self._own_optimiser = torch.optim.Adam(own, lr=rate, weight_decay=decay, foreach=True)
        penalty = rewards.alpha if config.penalty_weight is None else config.penalty_weight
        self._penalty_weight: Tensor | float = penalty[:, 0] if isinstance(penalty, Tensor) else penalty

    def train(
        self,
        expert: Transitions,
        negatives: Negatives,
        steps: int,
        iteration: int,
        generator: torch.Generator,
    ) -> dict[str, float]:
        """Take `steps` steps, the s-th on the s-th part of the samples; returns the last step's metrics."""
        config = self._config
        progress = min(1.0, iteration / max(1, self._iterations - 1))
        rate = config.learning_rate * (1.0 - (1.0 - config.learning_rate_end) * progress)
        for optimiser in (self._task_optimiser, self._own_optimiser):
            optimiser.param_groups[0]["lr"] = rate
        metrics: dict[str, float] = {}
        for step in range(steps):
            start = step * config.batch
            positive = expert.steps(start, config.batch)
            negative = negatives.transitions.steps(start, config.batch)
            others = self._others(positive, negative, generator)
            last = step == steps - 1
            loss, report = self._loss(positive, negative, others, with_report=last)
            self._task_optimiser.zero_grad()
            self._own_optimiser.zero_grad()
            loss.mean().backward()
            self._own_step()
            if config.task_update is TaskUpdate.SUMMED:
                self._task_step()
            else:
                self._sequential_task_steps(positive, negative, others)
            self._averaged.update(self._rewards)
            if last:
                metrics = report
        return metrics

    def _own_step(self) -> None:
        # Adam is blind to the scale of a gradient but not to the mean's 1 / S against weight decay: each
        # network sees the mean gradient of the losses of those whose own it is.
        if self._rewards.form is not RewardForm.TASK_ONLY:
            for group in self._own_optimiser.param_groups:
                for parameter in group["params"]:
                    if parameter.grad is not None:
                        parameter.grad.mul_(parameter.shape[0])
            self._own_optimiser.step()

    def _task_step(self) -> None:
        if self._rewards.form is not RewardForm.STRATEGY_ONLY:
            self._task_optimiser.step()

    def _sequential_task_steps(
        self, positive: Transitions, negative: Transitions, others: Transitions | None
    ) -> None:
        """One step of R0 for each strategy in turn, as Algorithm 1 is printed."""
        for strategy in range(self._rewards.strategies):
            loss, _ = self._loss(positive, negative, others, with_report=False)
            self._task_optimiser.zero_grad()
            loss[strategy].backward()
            self._task_step()

    def _others(
        self, positive: Transitions, negative: Transitions, generator: torch.Generator
    ) -> Transitions | None:
        """Other strategies' transitions for cross-negatives and the wider regulariser."""
        config = self._config
        wanted = config.cross_weight > 0.0 or config.penalise_all
        if not wanted or self._rewards.strategy_network.copies < 2:
            return None
        reward_groups = self._rewards.reward_groups
        demonstrations = round(config.cross_demonstrations * config.cross_batch)
        return Transitions.join(
            [
                of_others(positive, demonstrations, generator, reward_groups),
                of_others(negative, config.cross_batch - demonstrations, generator, reward_groups),
            ]
        )

    def _loss(
        self,
        positive: Transitions,
        negative: Transitions,
        others: Transitions | None,
        with_report: bool,
    ) -> tuple[Tensor, dict[str, float]]:
        """Equation 7 (or 6, by the form of the rewards) with the optional terms, ``[S]``."""
        config, rewards = self._config, self._rewards
        size = positive.packed.shape[1]
        together = Transitions.join([positive, negative] + ([others] if others is not None else []))
        task_inputs, strategy_inputs = rewards.task_inputs(together), rewards.strategy_inputs(together)
        own_slope = config.gradient_penalty > 0.0 and rewards.form is not RewardForm.TASK_ONLY
        task_slope = config.task_gradient_penalty > 0.0 and rewards.form is not RewardForm.STRATEGY_ONLY
        task_inputs.requires_grad_(task_slope)
        strategy_inputs.requires_grad_(own_slope)
        values = rewards.compose(task_inputs, strategy_inputs)
        combined = values.combined + rewards.shaping(together)
        logit = discriminator_logit(combined, together.log_prob)
        demonstrated, generated = logit[:, :size], logit[:, size : 2 * size]
        scope = values.strategy if config.penalise_all else values.strategy[:, : 2 * size]
        # Without the two columns there is nothing to distil: AIRL has no regulariser in the paper.
        distils = rewards.form in (RewardForm.TWO_COLUMN, RewardForm.VANILLA)
        weight = self._penalty_weight if distils else 0.0
        loss = distillation_loss(demonstrated, generated, scope, weight, config.penalty, config.penalty_above)
        if config.task_penalty_weight > 0.0:
            shared = values.combined if rewards.form is RewardForm.STRATEGY_ONLY else values.task
            loss = loss + config.task_penalty_weight * shared.square().mean(dim=1)
        if others is not None and config.cross_weight > 0.0:
            other = logit[:, 2 * size :]
            if not config.cross_reaches_task and rewards.form is RewardForm.TWO_COLUMN:
                task = values.task[:, 2 * size :]
                other = other - task + task.detach()
            loss = loss + config.cross_weight * cross_negative_loss(other)
        if own_slope:
            loss = loss + config.gradient_penalty * gradient_penalty(values.strategy, strategy_inputs)
        if task_slope:
            loss = loss + config.task_gradient_penalty * gradient_penalty(values.task, task_inputs)
        if not with_report:
            return loss, {}
        report = {
            "discriminator_loss": float(loss.detach().mean()),
            "demonstrations_right": float((demonstrated > 0.0).float().mean()),
            "generated_right": float((generated < 0.0).float().mean()),
            "strategy_reward_square": float(values.strategy.detach().square().mean()),
            "task_reward_demonstrations": float(values.task[:, :size].detach().mean()),
            "task_reward_generated": float(values.task[:, size : 2 * size].detach().mean()),
        }
        return loss, report

    def state_dict(self) -> dict[str, Any]:
        """State of the optimisers."""
        return {"task": self._task_optimiser.state_dict(), "own": self._own_optimiser.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up a state of `state_dict`."""
        self._task_optimiser.load_state_dict(state["task"])
        self._own_optimiser.load_state_dict(state["own"])
