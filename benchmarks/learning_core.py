"""How long one MSRD iteration takes, and what stepping all strategies in one tensor saves.

Run from the repository:
``python benchmarks/learning_core.py [--strategies 20] [--iterations 10] [--threads 1]``.
"Batched" is one trainer for all strategies; "looped" is the same work done strategy by strategy.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import torch

from msrd_ros.learning import policy_improvement
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.reward_training import RewardTraining
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.learning.value import ValueFunctions
from msrd_ros.studies.inverted_pendulum.presets import inverted_pendulum

PARTS: dict[str, tuple[Any, str]] = {
    "rollouts": (BatchedCollector, "collect"),
    "discriminator": (RewardTraining, "train"),
    "TRPO step": (policy_improvement, "trust_region_step"),
    "value fit": (ValueFunctions, "fit"),
}
"""What is timed: functions by their owner and name."""


class Drift:
    """A linear system with four columns: the cheapest environment, so that learning is what is timed."""

    observation_names = ("a", "b", "c", "d")
    action_names = ("u",)
    horizon = acting_steps = 250

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> np.ndarray:
        """Start near the origin."""
        self._state = rng.normal(scale=0.1, size=(strategies, episodes, 4))
        return self._state

    def step(self, action: np.ndarray) -> np.ndarray:
        """Decay, pushed in the last column."""
        self._state = 0.99 * self._state
        self._state[..., 3] += 0.04 * np.clip(action[..., 0], -3.0, 3.0)
        return self._state


def demonstrations(strategies: int) -> Demonstrations:
    """Random but bounded trajectories: their content does not matter for timing."""
    rng = np.random.default_rng(0)
    layout = Layout(Drift.observation_names, Drift.action_names, tuple(map(str, range(strategies))), 0.04)
    observations = rng.normal(scale=0.1, size=(strategies, 20, 251, 4))
    return Demonstrations(observations, rng.normal(size=(strategies, 20, 250, 1)), layout)


def measure(trainers: list[MSRD], iterations: int) -> dict[str, float]:
    """Seconds per iteration of all trainers together, in whole and by part."""
    for trainer in trainers:
        trainer.iterate()
    start = time.perf_counter()
    for trainer in trainers:
        for _ in range(iterations):
            trainer.iterate()
    return {"iteration": (time.perf_counter() - start) / iterations, **seconds_of_parts(trainers)}


def seconds_of_parts(trainers: list[MSRD]) -> dict[str, float]:
    """Seconds of one more iteration of all trainers together, by part.

    Value functions are fitted on a thread beside the TRPO step, so that the parts overlap.
    """
    seconds = dict.fromkeys(PARTS, 0.0)

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def run(*arguments: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments)
            finally:
                seconds[part] += time.perf_counter() - start

        return run

    with ExitStack() as patches:
        for part, (owner, name) in PARTS.items():
            patches.enter_context(mock.patch.object(owner, name, timed(part, getattr(owner, name))))
        for trainer in trainers:
            trainer.iterate()
    return seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strategies", type=int, default=20)
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    config = replace(inverted_pendulum(), iterations=options.iterations + 2)
    collector = BatchedCollector(Drift())
    batched = measure([MSRD(config, demonstrations(options.strategies), collector, 0)], options.iterations)
    alone = [MSRD(config, demonstrations(1), BatchedCollector(Drift()), i) for i in range(options.strategies)]
    looped = measure(alone, options.iterations)
    steps = options.strategies * config.episodes * Drift.horizon
    print(f"{options.strategies} strategies, {steps} steps an iteration, {options.threads} thread(s)")
    print(f"{'milliseconds':<16}{'batched':>10}{'looped':>10}{'ratio':>8}")
    for part in batched:
        ratio = looped[part] / batched[part]
        print(f"{part:<16}{1e3 * batched[part]:>10.1f}{1e3 * looped[part]:>10.1f}{ratio:>8.1f}")
    print(f"{steps / batched['iteration']:.0f} environment steps a second, learning included")


if __name__ == "__main__":
    main()
