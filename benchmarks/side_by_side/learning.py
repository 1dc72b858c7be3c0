"""AIRL and MSRD of the pendulum study beside AIRL of `imitation`: same demonstrations, one thread each."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.learning.rewards import RewardEnsemble
from msrd_ros.studies.inverted_pendulum.demonstrators import Kind, cached_demonstrators
from msrd_ros.studies.inverted_pendulum.study import PENDULUM, StudyPlan
from msrd_ros.studies.shared.estimates import from_rewards
from msrd_ros.studies.shared.evaluation import correlation, make_test_set, mean_over, normalised
from msrd_ros.studies.shared.method import Exercise
from msrd_ros.studies.shared.methods import PLAYING
from side_by_side.rivals import OLD_MUJOCO, SCRIPTS, environment
from side_by_side.table import Comparison

LEVEL = 0.9
NAME = "imitation 1.0.1, sb3-contrib 2.2.1"
NOTE = (
    "seconds of the processor; pendulum study, 20 demonstrators with 20 episodes each, AIRL on all of "
    "them together, TRPO, one thread, one after the other; r is the task reward's correlation over "
    "noise-injected trajectories, normalised per strategy"
)


@dataclass
class Curve:
    """What a method had learned at intervals: processor seconds, environment steps, and the reward's r."""

    seconds: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    r: list[float] = field(default_factory=list)

    @property
    def rate(self) -> float:
        """Environment steps a second, learning included."""
        return self.steps[-1] / self.seconds[-1]

    def first(self, level: float = LEVEL) -> float:
        """Seconds until r first reached `level`; NaN if it never did."""
        return next((s for s, r in zip(self.seconds, self.r, strict=True) if r >= level), float("nan"))


def compare(folder: Path, steps: int = 1_600_000, their_steps: int = 300_000) -> Iterator[Comparison]:
    """Lines of the table.

    Parameters
    ----------
    folder
        Where their environment is made.
    steps, their_steps
        How many environment steps either learns from: the study's whole budget, and what takes minutes there.
    """
    torch.set_num_threads(1)
    demonstrators = cached_demonstrators(Kind.DIAYN)
    data = demonstrators.demonstrate(20, seed=9400)
    test = make_test_set(PENDULUM, demonstrators, 9401)
    truth = normalised(test.task_truth)
    python = environment(folder / "old-mujoco", OLD_MUJOCO)
    with tempfile.TemporaryDirectory() as scratch:
        exchange, output = Path(scratch, "exchange.npz"), Path(scratch, "result.npz")
        flat = data.pooled()
        tests = test.noisy.reshape(-1, *test.noisy.shape[2:])
        np.savez(exchange, observations=flat.observations[0], actions=flat.actions[0], tests=tests)
        script = str(SCRIPTS / "imitation_airl.py")
        command = [str(python), script, str(exchange), str(output), str(their_steps)]
        subprocess.run(command, check=True, stdout=sys.stderr)
        found = np.load(output)
    shape = test.noisy.shape[:2]
    r = [correlation(normalised(row.reshape(shape)), truth) for row in found["estimates"]]
    theirs = Curve(found["times"].tolist(), found["steps"].tolist(), r)
    for method in ("airl", "msrd"):
        ours = learn(method, Exercise(PENDULUM, data, StudyPlan().budget, 9402), steps, test.noisy, truth)
        name = f"{method.upper()} on the pendulum"
        yield Comparison(
            f"{name}: environment steps, learning included", "/s", ours.rate, NAME, theirs.rate, note=NOTE
        )
        yield Comparison(
            f"{name}: until r of the task reward is {LEVEL}",
            "s",
            ours.first(),
            NAME,
            theirs.first(),
            less_is_better=True,
            note=NOTE,
        )


def learn(
    method: str, exercise: Exercise, steps: int, noisy: NDArray[np.floating], truth: NDArray[np.float64]
) -> Curve:
    """Train a method of ours; looks at its reward are not counted.

    Parameters
    ----------
    method
        One of the study's.
    exercise
        What it learns from.
    steps
        Environment steps to learn from.
    noisy
        Test trajectories.
    truth
        Their true task reward, normalised.
    """
    trainer = PLAYING[method].start(exercise)
    curve, paused_s, started_s = Curve(), 0.0, time.process_time()
    trainer.clone()
    while trainer.environment_steps < steps:
        trainer.iterate()
        if trainer.iterations_done % 2 and trainer.environment_steps < steps:
            continue
        now_s = time.process_time()
        estimate = from_rewards(PENDULUM, RewardEnsemble([trainer.averaged_rewards]), 0.0, 0)
        assert estimate.task is not None
        curve.r.append(correlation(normalised(mean_over(estimate.task, noisy)), truth))
        curve.seconds.append(now_s - started_s - paused_s)
        curve.steps.append(trainer.environment_steps)
        paused_s += time.process_time() - now_s
    return curve
