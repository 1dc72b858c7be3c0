"""The Hopper as the methods and marks of the studies in simulation see it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.studies.hopper.demonstrators import FEATURE_SCALES, hopper_features
from msrd_ros.studies.hopper.environment import (
    ACTION_NAMES,
    EPISODE_STEPS,
    FEATURE_NAMES,
    OBSERVATION_NAMES,
    TRUNK_NAMES,
    Hopper,
    HopperBody,
    is_healthy,
    task_reward,
)
from msrd_ros.studies.hopper.presets import hopper
from msrd_ros.studies.shared.task import VirtualTask

NOISE_LEVELS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
"""Probabilities of replacing an action by a random one, from the demonstrators to pure chance."""


def has_fallen(observations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether a hop ever stopped being healthy, in trajectories ``[2, ..., T+1, 12]`` of hop and crawl.

    A crawl lies down by intent and has nothing to fall from.
    """
    fallen = np.asarray(~is_healthy(observations).all(axis=-1))
    fallen[1:] = False
    return fallen


def make_collector(
    horizon: int, random_actions: float | NDArray[np.float64] = 0.0, body: HopperBody | None = None
) -> BatchedCollector:
    """Where policies are played."""
    return BatchedCollector(Hopper(horizon, body, random_actions))


def make_autoreset(horizon: int) -> BatchedCollector:
    """Where an episode that stopped being healthy starts again, as in Gymnasium's own Hopper."""
    return BatchedCollector(Hopper(horizon, autoreset=True))


def preset() -> MSRDConfig:
    """Settings of MSRD on this task."""
    return hopper(FEATURE_NAMES, FEATURE_SCALES, TRUNK_NAMES)


def airl_preset() -> MSRDConfig:
    """Settings of AIRL on all demonstrations, tuned by themselves: wider networks.

    One reward for both gaits has more to say: task r on two tuning pairs .85 with 16-16, .94 with 32-32, .89
    with 64-64. Other trust regions, rates, mixtures of negatives and penalties gave nothing more, nor did any
    of them for AIRL per strategy and vanilla distillation.
    """
    config = preset()
    return replace(config, reward=replace(config.reward, hidden=(32, 32)))


def as_printed_preset() -> MSRDConfig:
    """Settings of the paper's loss, tuned by themselves: a dearer S_i.

    On two tuning pairs lambda .003, .03, .1, .3 give task r .79, .87, .89, .90 and strategy r .87 and
    .81, .94 and .86, .94 and .84, .89 and .83.
    """
    config = preset()
    return replace(config, discriminator=replace(config.discriminator, penalty_weight=0.1))


HOPPER = VirtualTask(
    name="hopper",
    observation_width=len(OBSERVATION_NAMES),
    action_width=len(ACTION_NAMES),
    features=hopper_features(),
    preset=preset,
    make_collector=make_collector,
    horizon=EPISODE_STEPS,
    task_reward=task_reward,
    has_fallen=has_fallen,
    noise_levels=NOISE_LEVELS,
    identifying_feature=OBSERVATION_NAMES.index("torso_z"),
    make_autoreset=make_autoreset,
    own_presets={"airl": airl_preset, "msrd_as_printed": as_printed_preset},
)
