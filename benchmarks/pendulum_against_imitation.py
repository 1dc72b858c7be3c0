"""Speed of the pendulum study's AIRL and MSRD against the `imitation` library on the same demonstrations.

Run: ``python benchmarks/pendulum_against_imitation.py --imitation-python PATH [--steps 1000000]`` where PATH
is the interpreter of an environment with `imitation` (see ``imitation_airl.py``); without it only ours is
measured. One thread each. Prints environment steps a second, learning included, and the seconds until the
task reward's correlation over noise-injected trajectories, normalised per strategy, first reached 0.9 and
0.95.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch

from msrd_ros.learning.rewards import RewardEnsemble
from msrd_ros.studies.inverted_pendulum.demonstrators import Kind, cached_demonstrators
from msrd_ros.studies.inverted_pendulum.study import PENDULUM, StudyPlan
from msrd_ros.studies.shared.estimates import from_rewards
from msrd_ros.studies.shared.evaluation import (
    correlation,
    make_test_set,
    mean_over,
    normalised,
)
from msrd_ros.studies.shared.method import Exercise
from msrd_ros.studies.shared.methods import PLAYING

LEVELS = (0.9, 0.95)


def first_time(times: list[float], correlations: list[float], level: float) -> str:
    """Seconds until the correlation first reached `level`."""
    for seconds, r in zip(times, correlations, strict=True):
        if r >= level:
            return f"{seconds:.0f} s"
    return "never"


def describe(name: str, times: list[float], steps: list[int], correlations: list[float]) -> None:
    """Print one line."""
    rate = steps[-1] / times[-1]
    reached = ", ".join(f"r {level}: {first_time(times, correlations, level)}" for level in LEVELS)
    last = f"last r {correlations[-1]:.3f} after {times[-1]:.0f} s and {steps[-1]} steps"
    print(f"{name:<28}{rate:>9.0f} steps/s   {reached}; {last}", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--imitation-python", default=None)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument(
        "--every", type=int, default=5, help="iterations between two looks at the correlation"
    )
    options = parser.parse_args()
    torch.set_num_threads(1)
    demonstrators = cached_demonstrators(Kind.DIAYN)
    data = demonstrators.demonstrate(20, seed=9400)
    test = make_test_set(PENDULUM, demonstrators, 9401)
    truth = normalised(test.task_truth)
    budget = StudyPlan().budget
    for method in ("airl", "msrd"):
        trainer = PLAYING[method].start(Exercise(PENDULUM, data, budget, 9402))
        times, steps, correlations = [], [], []
        started = time.perf_counter()
        paused = 0.0
        trainer.clone()
        while trainer.environment_steps < options.steps:
            trainer.iterate()
            if trainer.iterations_done % options.every == 0 or trainer.environment_steps >= options.steps:
                now = time.perf_counter()
                estimate = from_rewards(PENDULUM, RewardEnsemble([trainer.averaged_rewards]), 0.0, 0)
                assert estimate.task is not None
                correlations.append(correlation(normalised(mean_over(estimate.task, test.noisy)), truth))
                times.append(now - started - paused)
                steps.append(trainer.environment_steps)
                paused += time.perf_counter() - now
        describe(f"msrd_ros {method}", times, steps, correlations)
    if options.imitation_python is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        exchange, output = Path(folder, "exchange.npz"), Path(folder, "result.npz")
        flat = data.pooled()
        tests = test.noisy.reshape(-1, *test.noisy.shape[2:])
        np.savez(exchange, observations=flat.observations[0], actions=flat.actions[0], tests=tests)
        script = Path(__file__).with_name("imitation_airl.py")
        command = [options.imitation_python, str(script), str(exchange), str(output), str(options.steps)]
        subprocess.run(command, check=True, stdout=sys.stderr)
        found = np.load(output)
        shape = test.noisy.shape[:2]
        correlations = [correlation(normalised(row.reshape(shape)), truth) for row in found["estimates"]]
        describe("imitation AIRL", found["times"].tolist(), found["steps"].tolist(), correlations)


if __name__ == "__main__":
    main()
