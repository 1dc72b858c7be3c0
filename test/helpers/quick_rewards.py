"""Rewards of strokes learned in seconds, without a simulator, against arms that stand still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, Episode
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.checkpoints import save_checkpoint
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns
from msrd_ros.table_tennis.strokes.training import StrokeTrainingConfig, stroke_recipe
from sawyer import ROBOT


def shipped_bag(subject: int, label: str, number: int = 1) -> Path:
    """One of the bags that come with the package."""
    return shipped_bags() / f"subject_{subject:02d}" / f"{label}_{number:03d}"


def shipped_strokes(subject: int) -> list[Episode]:
    """The first stroke of each label of a subject."""
    bags = [shipped_bag(subject, label) for label in ALL_LABELS]
    return [episode for bag in bags for episode in read_episodes(Bag(bag))]


def missed(episode: Episode) -> Episode:
    """The same with the arm at rest where it began and the ball going on as if nobody were there."""
    nearest = int(episode.ball_position[:, 0].argmin())
    last = nearest - 2
    since_s = CONTROL_PERIOD_S * np.arange(1, len(episode.ball_position) - last)[:, None]
    ball, velocity = episode.ball_position.copy(), episode.ball_velocity.copy()
    ball[last + 1 :] = ball[last] + since_s * velocity[last]
    velocity[last + 1 :] = velocity[last]
    return replace(
        episode,
        joint_position=np.tile(episode.joint_position[0], (len(ball), 1)),
        joint_velocity=np.zeros_like(episode.joint_velocity),
        ball_position=ball,
        ball_velocity=velocity,
        outcome=Outcome(1, struck=False, miss_reason=MissReason.MISSED),
    )


class StandingStill(Collector):
    """Plays nothing: every rollout is a demonstration that was missed.

    Parameters
    ----------
    demonstrations
        Of the missed strokes.
    """

    def __init__(self, demonstrations: Demonstrations) -> None:
        self._observations = np.asarray(demonstrations.observations, dtype=np.float32)

    def collect(
        self,
        policies: Policies,
        episodes: int,
        rng: np.random.Generator,
        deterministic: bool = False,
    ) -> Rollouts:
        """Missed strokes, ``[S, K, T+1, O]``, with little noise as a camera has it."""
        chosen = rng.integers(self._observations.shape[1], size=episodes)
        seen = self._observations[:, chosen]
        seen = seen + rng.normal(scale=1e-3, size=seen.shape).astype(np.float32)
        actions = np.zeros((*seen.shape[:2], ACTING_STEPS, policies.action_width), np.float32)
        log_probs = policies.rollout_log_probs(seen[:, :, :ACTING_STEPS], actions)
        return Rollouts(seen, actions, log_probs)


def learn_quickly(episodes: Sequence[Episode], iterations: int = 1) -> MSRD:
    """MSRD with the strokes' recipe, but for a few iterations that move nothing."""
    labels = Strategies.shipped().sort(episode.strategy for episode in episodes)
    recipe = stroke_recipe(StrokeTrainingConfig(iterations=iterations, episodes=8), labels, ROBOT)
    recipe = replace(
        recipe,
        discriminator=replace(recipe.discriminator, first_steps=200, batch=256, ema_rate=0.1),
        value=replace(recipe.value, steps=2),
    )
    strategies = Strategies.shipped()
    learner = MSRD(
        recipe,
        replace(gather_demonstrations(episodes, strategies), derived=PaddleColumns(ROBOT)),
        StandingStill(gather_demonstrations([missed(episode) for episode in episodes], strategies)),
        seed=0,
    )
    for _ in range(iterations):
        learner.iterate()
    return learner


def write_checkpoint(path: Path, episodes: Sequence[Episode]) -> Path:
    """A checkpoint of `learn_quickly`."""
    save_checkpoint(path, learn_quickly(episodes))
    return path
