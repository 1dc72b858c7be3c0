"""Rewards that were learned on one arm, and strokes that another learns from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import RefitConfig
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.method import Method
from msrd_ros.learning.methods.frozen_reward import FrozenReward
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policy import PolicySet
from msrd_ros.learning.rewards import RewardModel
from msrd_ros.learning.rollouts import Collector
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot, shipped_robots
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns
from msrd_ros.table_tennis.strokes.policies import StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.retargeting import RetargetingConfig, play_returned, retarget
from msrd_ros.table_tennis.strokes.training import StrokeTraining, StrokeTrainingConfig

REWARDS_FILE = "rewards.safetensors"
"""In the folder of a run: R0 and S_i to be optimised frozen, with the policies and ready poses of the run."""
REFIT = RefitConfig()
"""`MSRD.refit_on_replay` before rewards are frozen. With it, and without any price on leaving
the clone, the same stroke was still at 88 % after 60 iterations (see `frozen_reward.REFERENCE_PRICE`)."""

RETARGETED_PRICE = 0.1
"""Of a nat away from retargeted clones, less than the 1 of clones that are nearly right: poor ones must be
left."""


class Start(StrEnum):
    """Where policies on frozen rewards begin."""

    RETARGETED = "retargeted"
    """Cloned from the paddle's paths on the taught arm, by inverse kinematics."""
    NOTHING = "nothing"
    """Random weights: an arm that stands still. Where it waits is retargeted all the same."""


@dataclass(frozen=True)
class Taught:
    """What `save_rewards` wrote: the taught arm's policies, and rewards that do not change any more."""

    policies: StrokePolicies
    rewards: RewardModel


def lasting_rewards(training: StrokeTraining) -> RewardModel | None:
    """R0 and S_i refitted on all that was ever played; None where nothing was learned of it."""
    trainer = training.trainer
    if not (training.method.has_rewards and isinstance(trainer, MSRD) and trainer.iterations_done):
        return None
    steps = min(REFIT.steps, trainer.iterations_done * trainer.config.discriminator.steps)
    return trainer.refit_on_replay(replace(REFIT, steps=steps))


def save_rewards(training: StrokeTraining, path: Path) -> None:
    """Write policies and lasting rewards to one file; nothing where no reward was learned.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    rewards = lasting_rewards(training)
    if rewards is not None:
        policies = training.policies().described
        Learned(policies, rewards, policies.details).save(path)


def load_taught(path: Path, taught_on: str = "") -> Taught:
    """Read what `save_rewards` wrote.

    Parameters
    ----------
    taught_on
        Name or folder of the arm that was taught; empty: the shipped one that the file names.

    Raises
    ------
    UserError
        If the file is damaged or holds no rewards, or the arm is not to be had.
    """
    name = str(PolicySet.load(path).details.get("robot", DEFAULT_ROBOT)).partition("@")[0]
    if not taught_on and name not in shipped_robots():
        raise UserError(f"{path}: was taught on {name}, which does not ship; say taught_on:=FOLDER of it")
    policies = StrokePolicies.load(path, load_robot(taught_on or name))
    rewards = Learned.load(path).rewards
    if rewards is None:
        raise UserError(
            f"{path}: holds policies and no rewards; give the {REWARDS_FILE} of a run that learned some"
        )
    return Taught(policies, rewards)


def price_of(start: Start) -> float:
    """Of a nat away from where policies begin; random weights may be left for nothing."""
    return RETARGETED_PRICE if start is Start.RETARGETED else 0.0


@dataclass(frozen=True)
class Transfer:
    """A run on frozen rewards before its first step, and the retargeted strokes that it may begin from."""

    training: StrokeTraining
    episodes: Sequence[Episode]
    account: Sequence[str]


def transfer(
    taught: Taught,
    robot: Robot,
    config: StrokeTrainingConfig,
    start: Start = Start.RETARGETED,
    collector: Collector | None = None,
    strategies: Strategies | None = None,
    retargeting: RetargetingConfig | None = None,
    method: Method | None = None,
) -> Transfer:
    """Set up a run that teaches an arm all strokes of another from its frozen rewards.

    Parameters
    ----------
    taught
        Of the other arm.
    robot
        The arm that is to learn; nobody has shown it anything.
    config
        Settings; its method is not looked at.
    start
        Where the policies begin.
    collector, strategies
        As of `StrokeTraining`.
    retargeting
        How the taught arm's strokes become this one's; None: with the seed and spread of `config`.
    method
        What improves the policies; None: `FrozenReward` on the taught rewards.

    Raises
    ------
    UserError
        If the rewards see what this arm has not, such as the taught arm's joints.
    """
    columns = PaddleColumns(robot)
    try:
        rewards = taught.rewards.on(stroke_layout(robot).observation_names, columns)
    except UserError as error:
        raise UserError(
            f"{error}. Rewards of the joints are of one arm alone; train them again, they see the paddle now"
        ) from None
    settings = retargeting or RetargetingConfig(spread=config.spread, seed=config.seed)
    found = retarget(play_returned(taught.policies, settings), taught.policies.robot, robot, settings)
    if start is Start.NOTHING:
        config = replace(config, corrective_cloning=False, cloning_steps=0)
    training = StrokeTraining(
        found.episodes,
        {label: facts.landing_point for label, facts in taught.policies.facts.items()},
        config,
        collector,
        strategies,
        method or FrozenReward(rewards, price_of(start)),
    )
    account = [
        f"{label}: the blade is {100.0 * found.miss_m[label]:.1f} cm and {found.miss_rad[label]:.2f} rad off "
        f"the path of {taught.policies.robot.name}"
        for label in found.miss_m
    ]
    return Transfer(training, found.episodes, account)
