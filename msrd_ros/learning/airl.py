"""Adversarial IRL (Fu et al., 2018), the paper's baseline, behind the same interface as MSRD.

AIRL is Algorithm 1 with one reward and no regulariser, so both variants are forms of the same trainer:
same networks, same updates, same budget.
"""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations


def pooled_airl(
    config: MSRDConfig,
    demonstrations: Demonstrations,
    collector: Collector,
    seed: int,
    autoreset: Collector | None = None,
) -> MSRD:
    """One reward and one policy for the demonstrations of all strategies together; arguments as of `MSRD`.

    It plays and samples as many transitions an iteration as MSRD does for all strategies.
    """
    strategies = demonstrations.strategies
    discriminator = replace(
        config.discriminator,
        batch=config.discriminator.batch * strategies,
        cross_weight=0.0,
        gradient_penalty=0.0,
        penalise_all=False,
    )
    config = replace(
        config,
        episodes=config.episodes * strategies,
        reward=replace(config.reward, form=RewardForm.TASK_ONLY, alpha=1.0),
        discriminator=discriminator,
        replay=replace(config.replay, keep=config.replay.keep * strategies),
        cloning=replace(
            config.cloning,
            batch=config.cloning.batch * strategies,
            snapshot_episodes=config.cloning.snapshot_episodes * strategies,
        ),
    )
    return MSRD(config, demonstrations.pooled(), collector, seed, autoreset=autoreset)


def airl_per_strategy(
    config: MSRDConfig,
    demonstrations: Demonstrations,
    collector: Collector,
    seed: int,
    autoreset: Collector | None = None,
) -> MSRD:
    """A reward of its own for each strategy, nothing shared, trained side by side; arguments as of `MSRD`."""
    config = replace(config, reward=replace(config.reward, form=RewardForm.STRATEGY_ONLY, alpha=1.0))
    return MSRD(config, demonstrations, collector, seed, autoreset=autoreset)
