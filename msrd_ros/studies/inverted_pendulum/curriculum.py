"""Training in stages: short episodes while a policy cannot stand yet, longer ones as soon as it can."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from msrd_ros.learning.harness import iterations
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.studies.inverted_pendulum.dynamics import PendulumBody
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector


@dataclass(frozen=True)
class Stage:
    """A part of a training.

    Attributes
    ----------
    iterations
        TRPO updates.
    episodes
        Rollouts per strategy and update.
    horizon
        Steps per rollout, of 0.04 s each.
    """

    iterations: int
    episodes: int
    horizon: int


def train_in_stages(
    training: PolicyTraining,
    stages: tuple[Stage, ...],
    body: PendulumBody | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> None:
    """Go through `stages` one after the other.

    Parameters
    ----------
    training
        Its collector and number of episodes are replaced by each stage's.
    body
        Masses and lengths that are played with; None for Gymnasium's.
    progress
        Told the mean reward every 20 updates and after each stage.
    """
    for stage in stages:
        training.collector = PendulumCollector(stage.horizon, body)
        training.episodes = stage.episodes
        for done, metrics in iterations(training, stage.iterations):
            if done % 20 == 0 or done == stage.iterations:
                which = f"{done} of {stage.iterations} updates on {stage.horizon} steps"
                progress(f"{which}, reward {metrics['reward']:.3f}")
