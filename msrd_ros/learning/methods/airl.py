"""Adversarial IRL (Fu et al., 2018), the paper's baseline: Algorithm 1 with one reward and no regulariser.

Same networks, same updates, same budget as MSRD's.
"""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.trajectories import Demonstrations


class Airl(Method):
    """One reward and one policy for the demonstrations of all strategies together."""

    name = "airl"
    title = "AIRL on all demonstrations"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """R_i = R0; plays and samples as many transitions an iteration as MSRD does for all strategies."""
        return replace(
            config,
            episodes=config.episodes * strategies,
            reward=replace(config.reward, form=RewardForm.TASK_ONLY, alpha=1.0, reward_groups=()),
            discriminator=replace(
                config.discriminator,
                batch=config.discriminator.batch * strategies,
                cross_weight=0.0,
                gradient_penalty=0.0,
                penalise_all=False,
            ),
            replay=replace(config.replay, keep=config.replay.keep * strategies),
            cloning=replace(
                config.cloning,
                batch=config.cloning.batch * strategies,
                snapshot_episodes=config.cloning.snapshot_episodes * strategies,
            ),
        )

    def arrange(self, demonstrations: Demonstrations) -> Demonstrations:
        """All of one strategy."""
        return demonstrations.pooled()


class AirlEachCross(Method):
    """A reward of its own for each strategy, nothing shared, with all other terms of the recipe."""

    name = "airl_each_cross"
    title = "AIRL per strategy, same terms"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """R_i = S_i."""
        return replace(config, reward=replace(config.reward, form=RewardForm.STRATEGY_ONLY, alpha=1.0))


class AirlEach(AirlEachCross):
    """A reward of its own for each strategy and nothing that AIRL does not have."""

    name = "airl_each"
    title = "AIRL per strategy"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """R_i = S_i without any terms of ours."""
        return super().configure(as_printed(config), strategies)
