"""Vanilla reward distillation, the paper's step on the way to MSRD (Equations 5 and 6)."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method
from msrd_ros.learning.rewards import RewardForm


class VanillaDistillation(Method):
    """A reward network for each strategy, R0 the one they are all pulled towards, S_i = R_i - R0."""

    name = "vanilla_distillation"
    title = "vanilla distillation, same terms"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """Another form of the rewards."""
        return replace(config, reward=replace(config.reward, form=RewardForm.VANILLA))
