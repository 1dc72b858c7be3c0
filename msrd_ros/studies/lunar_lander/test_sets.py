"""Trajectories to judge task rewards on: from crashed to landed, with the published spread of true returns.

FLAIR judges rewards on trajectories of policies along a run of reinforcement learning, which are not to be
had. These come in three equal parts from reinforcement learning on the truth, from noisy clones of the
demonstrations and from reinforcement learning that starts with clones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.core.files import write_atomically
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods import find_method
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.lunar_lander.drawing import CRASHED_BELOW, LANDED_ABOVE, draw
from msrd_ros.studies.lunar_lander.environment import LOST, RESTING, make_collector, step_rewards

SOURCES = ("reinforcement learning", "noisy clones", "reinforcement learning from clones")
REWARD_SCALE = 100.0


@dataclass(frozen=True)
class SetPlan:
    """How a set is made.

    Attributes
    ----------
    trajectories
        How many are kept.
    learners, episodes, updates
        Policies that learn from random weights, their episodes an update, and updates.
    clone_episodes, clone_updates
        The same of the clones, one for each strategy.
    noise_levels, noisy_episodes
        Standard deviations of the noise on the clones' actions, and episodes at each.
    """

    trajectories: int = 1000
    learners: int = 6
    episodes: int = 5
    updates: int = 40
    clone_episodes: int = 8
    clone_updates: int = 15
    noise_levels: tuple[float, ...] = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 1.0)
    noisy_episodes: int = 16


@dataclass(frozen=True)
class TestSet:
    """Trajectories and what is true of them.

    Attributes
    ----------
    observations
        ``[N, T+1, 8]``.
    truth
        Undiscounted sum of the true reward, ``[N]``.
    lost, rested
        Whether it ever crashed or left the bounds, and whether it ever came to rest, ``[N]``.
    source
        Index into `SOURCES`, ``[N]``.
    """

    observations: NDArray[np.float32]
    truth: NDArray[np.float64]
    lost: NDArray[np.bool_]
    rested: NDArray[np.bool_]
    source: NDArray[np.int64]

    __test__ = False

    @property
    def middle(self) -> NDArray[np.bool_]:
        """Which neither crashed nor rested, ``[N]``."""
        return ~(self.lost | self.rested)

    def describe(self) -> dict[str, Any]:
        """How the true returns are spread, as data for JSON."""
        return {
            "trajectories": len(self.truth),
            "below": float((self.truth < CRASHED_BELOW).mean()),
            "above": float((self.truth > LANDED_ABOVE).mean()),
            "neither": float(self.middle.mean()),
            "lost_and_rested": float((self.lost & self.rested).mean()),
            "sd": float(self.truth.std()),
            "sources": [int((self.source == index).sum()) for index in range(len(SOURCES))],
        }

    def take(self, rows: NDArray[np.int64]) -> TestSet:
        """Some of the trajectories."""
        return TestSet(*(values[rows] for values in vars(self).values()))

    @classmethod
    def of(cls, played: Sequence[Rollouts], source: int) -> TestSet:
        """All trajectories of rollouts from one source."""
        reward = np.concatenate([step_rewards(part).reshape(-1, part.actions.shape[2]) for part in played])
        states = np.concatenate(
            [part.observations.reshape(-1, *part.observations.shape[2:]) for part in played]
        )
        lost, rested = ((reward == paid).any(axis=1) for paid in (LOST, RESTING))
        return cls(states, reward.sum(axis=1), lost, rested, np.full(len(reward), source))

    @classmethod
    def join(cls, parts: Sequence[TestSet]) -> TestSet:
        """One after the other."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))


class TrueReward:
    """The environment's own, in units in which values are a few."""

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """``[S, K, T]``."""
        return torch.as_tensor(step_rewards(rollouts) / REWARD_SCALE, dtype=torch.float32)


class Keeping:
    """Keeps whatever a collector plays.

    Parameters
    ----------
    collector
        Where policies are really played.
    """

    def __init__(self, collector: Collector) -> None:
        self._collector = collector
        self.played: list[Rollouts] = []

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        """As the collector does."""
        self.played.append(self._collector.collect(policies, episodes, rng))
        return self.played[-1]


def make_test_set(
    demonstrations: Demonstrations, plan: SetPlan, seed: int, progress: Callable[[str], None]
) -> TestSet:
    """Play and learn in all three ways, then draw.

    Parameters
    ----------
    demonstrations
        What is cloned.
    seed
        Everything random follows from it.
    """
    rng = np.random.default_rng([seed, 5])
    config = default_config(restarts=False)
    features = config.policy.features.build(demonstrations)
    generator = torch.Generator().manual_seed(seed)
    fresh = GaussianPolicies(
        plan.learners, features, 2, (64, 64), float(np.log(0.6)), float(np.log(0.1)), 0.0, generator
    )
    progress(f"test set {seed}: {SOURCES[0]}")
    learned = _learn(fresh, features, plan.episodes, plan.updates, seed)
    progress(f"test set {seed}: {SOURCES[1]}")
    cloning = find_method("cloning").start(Problem(config, demonstrations, make_collector(), seed))
    cloning.clone()
    clones = cloning.policies
    assert isinstance(clones, GaussianPolicies)
    started = clones.log_std.detach().clone()
    noisy = Keeping(make_collector())
    for level in plan.noise_levels:
        clones.log_std.data.fill_(float(np.log(level)))
        noisy.collect(clones, plan.noisy_episodes, rng)
    clones.log_std.data.copy_(started)
    progress(f"test set {seed}: {SOURCES[2]}")
    improved = _learn(clones, features, plan.clone_episodes, plan.clone_updates, seed + 1)
    pool = TestSet.join(
        [TestSet.of(played, index) for index, played in enumerate((learned, noisy.played, improved))]
    )
    return pool.take(draw(pool.truth, pool.middle, pool.source, plan.trajectories, rng))


def _learn(
    policies: GaussianPolicies, features: Features, episodes: int, updates: int, seed: int
) -> list[Rollouts]:
    """Reinforcement learning on the truth; all that was played on the way."""
    keeping = Keeping(make_collector())
    training = PolicyTraining(
        policies,
        features,
        TrueReward(),
        keeping,
        episodes,
        TrustRegionConfig(kl=0.03, damping=0.05, entropy_weight=0.003),
        ValueConfig(steps=60, sees_time=False, bootstrap=True),
        seed,
    )
    for _ in range(updates):
        training.iterate()
    return keeping.played


def kept_test_set(path: Path, make: Callable[[], TestSet]) -> TestSet:
    """The set that is kept at `path`; if there is none yet, what `make` gives is."""
    if not path.exists():
        buffer = BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **vars(make()))
        write_atomically(path, buffer.getvalue())
    with np.load(path, allow_pickle=False) as arrays:
        return TestSet(**{name: arrays[name] for name in TestSet.__dataclass_fields__})
