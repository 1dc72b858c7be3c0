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
        """No sweeps, and no bad examples for a discriminator that there is not."""
        cloning = replace(config.cloning, snapshots=(), disturbances=(), restarts=())
        return replace(config, sweeps=0, cloning=cloning)
