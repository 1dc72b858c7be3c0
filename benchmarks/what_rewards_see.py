"""What it costs, on the arm that was taught, that strategy rewards see the paddle and not the joints.

Run from the repository: ``python benchmarks/what_rewards_see.py [--iterations 30] [--seeds 2]``.
Trained on two of the three subjects whose bags ship. "Returned" is the mean and the worst stroke of
the mean policies, 400 balls a stroke in the batched simulator. "Kept" is how many strategy rewards are
highest for their own stroke, of six, on the strokes of the subject kept from training, and "played" the share
of 50 played balls a stroke along which the own strategy reward is the highest, all in units of its scatter.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
import torch

from msrd_ros.contract.episode import BALL_NAMES
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.config import FeatureConfig, MSRDConfig
from msrd_ros.learning.methods.msrd import Msrd
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.robots.loading import default_robot
from msrd_ros.studies.table_tennis.recording import load_episodes
from msrd_ros.studies.table_tennis.statistics import diagonal_wins
from msrd_ros.table_tennis.strokes.training import StrokeTraining, StrokeTrainingConfig, mean_landing_points

KEPT = "subject_03"
SEED = 9300
BALLS, PLAYED = 400, 50


class SeesJoints(Msrd):
    """The recipe of before: S_i sees the ball and the joints."""

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """Other columns."""
        features = FeatureConfig(names=BALL_NAMES + default_robot().joint_names)
        return replace(config, reward=replace(config.reward, strategy_features=features))


def own_rates(training: StrokeTraining, seed: int) -> float:
    """Share of played strokes along which the own strategy reward is the highest."""
    simulator = training.simulator
    played = BatchedCollector(simulator).collect(
        training.trainer.policies, PLAYED, np.random.default_rng((seed, 2)), deterministic=True
    )
    found = np.stack([training.rewards_of(seen, 0)[1] for seen in played.observations], axis=1)
    flat = found.reshape(len(found), -1)
    scaled = (found - flat.mean(axis=1)[:, None, None]) / flat.std(axis=1)[:, None, None]
    own = np.arange(len(found))[:, None]
    return float((scaled.argmax(axis=0) == own).mean())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--iterations", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(1)
    episodes = load_episodes(shipped_bags(), lambda line: None)
    shown = [episode for episode in episodes if episode.subject != KEPT]
    kept = [episode for episode in episodes if episode.subject == KEPT]
    print(f"{'S_i sees':<10}{'seed':>6}{'returned':>14}{'kept':>6}{'played':>8}{'s an iteration':>16}")
    for name, method in (("joints", SeesJoints()), ("paddle", Msrd())):
        for seed in range(SEED, SEED + options.seeds):
            settings = StrokeTrainingConfig(iterations=options.iterations, seed=seed, threads=1)
            training = StrokeTraining(shown, mean_landing_points(shown), settings, method=method)
            training.trainer.clone()
            started = time.process_time()
            for _ in range(options.iterations):
                training.trainer.iterate()
            each_s = (time.process_time() - started) / options.iterations
            returned = 100.0 * training.evaluate(BALLS, np.random.default_rng((seed, 1)))[1]
            wins = diagonal_wins(training.strategy_matrix(kept))
            print(
                f"{name:<10}{seed:>6}{returned.mean():>8.1f} / {returned.min():<3.0f}{wins:>6}"
                f"{100.0 * own_rates(training, seed):>7.1f}%{each_s:>16.2f}"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
