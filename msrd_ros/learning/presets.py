"""Named changes of a configuration: the paper's loss and nothing added to it."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.config import MSRDConfig


def as_printed(config: MSRDConfig) -> MSRDConfig:
    """The same run with the paper's loss and nothing added to it."""
    discriminator = replace(
        config.discriminator,
        cross_weight=0.0,
        gradient_penalty=0.0,
        task_gradient_penalty=0.0,
        penalty_above=1.0,
        task_penalty_weight=0.0,
        penalise_all=False,
    )
    return replace(
        config,
        discriminator=discriminator,
        reward=replace(config.reward, nearness=0.0),
        replay=replace(config.replay, displaced_share=0.0),
    )
