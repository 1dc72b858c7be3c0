"""What each part of the table tennis recipe brings, and where the time of an iteration goes.

Run from the repository:
``python benchmarks/stroke_training.py [--iterations 40] [--seeds 2] [--only NAME ...]``.
Every row is the recipe with one thing changed, trained on the bags that the package ships. "Returned" is the
mean and the worst stroke of the mean policies over 400 balls a stroke in the batched simulator, start
postures scattered by 0.03 rad, on seeds that training does not draw from.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from learning_core import PARTS, seconds_of_parts
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.config import MSRDConfig, PolicyReward
from msrd_ros.learning.methods.msrd import Msrd
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.presets import as_printed
from msrd_ros.studies.table_tennis.recording import load_episodes
from msrd_ros.table_tennis.strokes.training import StrokeTraining, StrokeTrainingConfig, mean_landing_points

BALLS = 400
EVERY = 5
GOOD = 0.95

Change = Callable[[MSRDConfig], MSRDConfig]


@dataclass(frozen=True)
class Variant:
    """The recipe with one thing changed: its settings, its start, or what it trains on."""

    change: Change = lambda config: config
    cloned: bool = True
    scattered: bool = True


def trust_region(**changes: Any) -> Change:
    """Other settings of the natural gradient."""
    return lambda config: replace(config, trust_region=replace(config.trust_region, **changes))


def value(**changes: Any) -> Change:
    """Other settings of the value functions."""
    return lambda config: replace(config, value=replace(config.value, **changes))


def policy(**changes: Any) -> Change:
    """Other settings of the policies."""
    return lambda config: replace(config, policy=replace(config.policy, **changes))


def discriminator(**changes: Any) -> Change:
    """Other settings of the rewards' training."""
    return lambda config: replace(config, discriminator=replace(config.discriminator, **changes))


class Changed(Msrd):
    """MSRD with another recipe."""

    def __init__(self, change: Change) -> None:
        self._change = change

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """The change."""
        return self._change(config)


VARIANTS = {
    "the recipe": Variant(),
    "no cloning before": Variant(cloned=False),
    "start postures not scattered": Variant(scattered=False),
    "exploration 0.2 of full speed": Variant(policy(std=0.2, std_max=0.25)),
    "exploration 0.03": Variant(policy(std=0.03, std_max=0.04)),
    "R - log pi as the reward": Variant(lambda config: replace(config, policy_reward=PolicyReward.LOGIT)),
    "the paper's loss": Variant(as_printed),
    "10 CG steps on a fifth, damping 0.1": Variant(
        trust_region(cg_iterations=10, fisher_fraction=0.2, damping=0.1)
    ),
    "20 steps of value fitting": Variant(value(steps=20)),
    "half the steps of the rewards": Variant(discriminator(steps=10)),
}


def train(
    variant: Variant, seed: int, iterations: int
) -> tuple[list[tuple[float, np.ndarray]], dict[str, float]]:
    """Seconds and returned shares by stroke every few iterations, and milliseconds an iteration by part."""
    episodes = load_episodes(shipped_bags(), lambda line: None)
    noise_rad = 0.03 if variant.scattered else 0.0
    settings = StrokeTrainingConfig(iterations=iterations, seed=9100 + seed, ready_noise_rad=noise_rad)
    method = Changed(variant.change)
    training = StrokeTraining(episodes, mean_landing_points(episodes), settings, method=method)
    judging = StrokeTraining(episodes, {}, replace(settings, ready_noise_rad=0.03))
    judging.trainer = training.trainer
    curve = []
    seconds = 0.0
    parts: dict[str, float] = {}
    for iteration in range(iterations + 1):
        started = time.perf_counter()
        if iteration == iterations:
            assert isinstance(training.trainer, MSRD)
            parts = seconds_of_parts([training.trainer])
        elif iteration:
            training.trainer.iterate()
        elif variant.cloned:
            training.trainer.clone()
        seconds += time.perf_counter() - started
        if iteration % EVERY == 0:
            curve.append((seconds, judging.evaluate(BALLS, np.random.default_rng((seed, iteration)))[1]))
    return curve, parts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=40)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    options = parser.parse_args()
    torch.set_num_threads(1)
    print(
        f"{options.iterations} iterations, {options.seeds} seed(s); returned: % of balls, mean / worst stroke"
    )
    print(f"{'':<38}{'start':>10}{'end':>12}{'s to 95 %':>12}{'s an iteration':>11}  {', '.join(PARTS)} (ms)")
    for name in options.only:
        start, end, reached, iteration, shares = [], [], [], [], []
        for seed in range(options.seeds):
            curve, parts = train(VARIANTS[name], seed, options.iterations)
            start.append(curve[0][1])
            end.append(curve[-1][1])
            reached.append(next((at for at, returned in curve if returned.min() >= GOOD), np.inf))
            iteration.append((curve[-1][0] - curve[0][0]) / options.iterations)
            shares.append([1e3 * parts[part] for part in PARTS])
        first, last = (100 * np.mean(rows, axis=0) for rows in (start, end))
        print(
            f"{name:<38}{first.mean():>5.0f} / {first.min():<2.0f}{last.mean():>7.1f} / {last.min():<3.0f}"
            f"{np.mean(reached):>11.0f}{np.mean(iteration):>11.2f}  "
            f"{', '.join(f'{part:.0f}' for part in np.mean(shares, axis=0))}"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
