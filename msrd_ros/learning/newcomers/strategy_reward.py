"""One strategy reward more, while R0 and all others stay as they are, to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import DiscriminatorConfig
from msrd_ros.learning.networks import BatchedMLP
from msrd_ros.learning.reward_training import Negatives, RewardTraining
from msrd_ros.learning.rewards import AveragedRewards, RewardForm, RewardModel
from msrd_ros.learning.trajectories import Transitions

STEPS = 800
"""Adam steps: the same for the hundredth teacher as for the first."""


def learn_strategy_reward(
    rewards: RewardModel,
    shown: Transitions,
    played: Transitions,
    others: Transitions,
    config: DiscriminatorConfig,
    generator: torch.Generator,
) -> RewardModel:
    """Rewards of S + 1 strategies: the last is of whoever made the transitions `shown`.

    Equation 7 with R0 frozen, for the newcomer alone. Demonstrations of the known strategies are
    cross-negatives, whatever the recipe says of them: with R0 frozen they are all that tells the newcomer's
    reward from the task's. Of the time it takes nothing depends on S.

    Parameters
    ----------
    rewards
        R0 and S_1..S_S; stays as it is.
    shown, played, others
        ``[1, n]`` each, of any n: demonstrations of the newcomer and rollouts of its policy, both with its
        log-density as the discriminator is to use it, and demonstrations of the known strategies.
    config
        The recipe of the discriminator.

    Raises
    ------
    UserError
        If the rewards have not both columns, or a potential.
    """
    if rewards.form is not RewardForm.TWO_COLUMN or rewards.potential_network is not None:
        raise UserError("newcomers: rewards need R0 and S_i, without shaping; train with method msrd")
    # The second row is the known strategies as if they were one: where cross-negatives come from.
    pair = rewards.with_room((0, 1), float(rewards.alpha.mean()), generator)
    for parameter in pair.task_parameters():
        parameter.requires_grad_(False)
    settings = replace(
        config,
        cross_weight=max(config.cross_weight, 1.0),
        cross_demonstrations=1.0,
        task_penalty_weight=0.0,
        task_gradient_penalty=0.0,
    )
    averaged = AveragedRewards(pair, config.ema_rate)
    training = RewardTraining(pair, averaged, settings, STEPS // settings.steps)
    amount = settings.steps * settings.batch
    for iteration in range(STEPS // settings.steps):
        expert = _drawn((shown, others), amount, generator)
        training.train(
            expert,
            Negatives(_drawn((played, played), amount, generator)),
            settings.steps,
            iteration,
            generator,
        )
    return _appended(rewards, averaged.model, generator)


def _drawn(rows: tuple[Transitions, Transitions], amount: int, generator: torch.Generator) -> Transitions:
    """``[2, amount]`` transitions, drawn from each row's."""
    packed = [
        row.packed[0, torch.randint(row.packed.shape[1], (amount,), generator=generator)] for row in rows
    ]
    return Transitions(torch.stack(packed), rows[0].observation_width, rows[0].action_width)


def _appended(rewards: RewardModel, pair: RewardModel, generator: torch.Generator) -> RewardModel:
    """`rewards` with the first strategy of `pair` as one more."""
    groups = _groups(rewards)
    return _composed(
        rewards,
        [(rewards.strategy_network, row) for row in range(rewards.strategy_network.copies)]
        + [(pair.strategy_network, 0)],
        (*groups, max(groups) + 1),
        (*rewards.alpha[:, 0].tolist(), float(pair.alpha[0])),
        generator,
    )


def without_strategy(rewards: RewardModel, strategy: int, generator: torch.Generator) -> RewardModel:
    """Rewards without one strategy that shares its reward with no other; the others stay, to the bit."""
    groups = _groups(rewards)
    gone = groups[strategy]
    kept = [row for row in range(rewards.strategies) if row != strategy]
    return _composed(
        rewards,
        [(rewards.strategy_network, row) for row in range(rewards.strategy_network.copies) if row != gone],
        tuple(groups[row] - (groups[row] > gone) for row in kept),
        tuple(float(rewards.alpha[row, 0]) for row in kept),
        generator,
    )


def _groups(rewards: RewardModel) -> list[int]:
    groups = rewards.reward_groups
    return list(range(rewards.strategies)) if groups is None else [int(group) for group in groups]


def _composed(
    rewards: RewardModel,
    networks: Sequence[tuple[BatchedMLP, int]],
    groups: tuple[int, ...],
    alpha: tuple[float, ...],
    generator: torch.Generator,
) -> RewardModel:
    """R0 of `rewards` and strategy networks taken from anywhere, by row."""
    model = rewards.with_room(groups, alpha, generator)
    with torch.no_grad():
        for name in ("weights", "biases"):
            for layer, target in enumerate(getattr(model.strategy_network, name)):
                target.copy_(torch.stack([getattr(network, name)[layer][row] for network, row in networks]))
    return model.requires_grad_(False)
