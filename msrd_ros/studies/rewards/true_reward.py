"""What a referee would pay: the ceiling of every learned reward."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods.frozen_reward import EnvironmentReward, FrozenRewardTraining
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.table_tennis.simulation.batched import KinematicRallies, RallyResults
from msrd_ros.table_tennis.strategies.table import Strategies

PAID = 70.0
"""For a ball that is returned with the right spin, so that a nat away from the clones weighs as much beside
it as beside R0: R0 of a return and of the same undone are 2.2 a step apart, over some 32 steps."""


def right_spins(labels: tuple[StrategyLabel, ...], results: RallyResults) -> NDArray[np.bool_]:
    """Which balls were returned with the spin of their strategy, (S, K)."""
    judge = Strategies.shipped()
    right = np.array(
        [
            [bool(judge.spin_is_right(label, float(spin))) for spin in row]
            for label, row in zip(labels, np.nan_to_num(results.spin[..., 1]), strict=True)
        ]
    )
    found: NDArray[np.bool_] = results.returned & right
    return found


class Referee(BatchedCollector):
    """Plays, and pays `PAID` at the end of a stroke whose ball is returned with the right spin.

    Parameters
    ----------
    simulator
        Where to play.
    labels
        The strategies, in the order of its plans.
    """

    def __init__(self, simulator: KinematicRallies, labels: tuple[StrategyLabel, ...]) -> None:
        super().__init__(simulator)
        self._simulator, self._labels = simulator, labels

    def collect(
        self, policies: Policies, episodes: int, rng: np.random.Generator, deterministic: bool = False
    ) -> Rollouts:
        """Play `episodes` strokes of every strategy."""
        played = super().collect(policies, episodes, rng, deterministic)
        paid = np.zeros((*played.observations.shape[:2], self._simulator.horizon), np.float32)
        paid[..., -1] = PAID * right_spins(self._labels, self._simulator.results())
        return replace(played, environment_reward=paid)


class TrueReward(EnvironmentReward):
    """TRPO on what a `Referee` pays, in the batched simulator."""

    def start(self, problem: Problem) -> FrozenRewardTraining:
        """The same balls and start postures; only who pays is another."""
        collector = problem.collector
        if not isinstance(collector, BatchedCollector) or not isinstance(
            collector.environment, KinematicRallies
        ):
            raise TypeError("a referee looks on in the batched simulator alone")
        labels = tuple(map(StrategyLabel, problem.demonstrations.layout.labels))
        return super().start(replace(problem, collector=Referee(collector.environment, labels)))
