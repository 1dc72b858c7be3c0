"""Behaviour cloning: the demonstrated actions by least squares, and nothing is played."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method


class Cloning(Method):
    """Policies without rewards."""

    name = "cloning"
    title = "behaviour cloning"
    has_rewards = False

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """No iterations, and no bad examples for a discriminator that there is not."""
        cloning = replace(config.cloning, snapshots=(), noise_levels=(), restarts=())
        return replace(config, iterations=0, cloning=cloning)
