"""The harness: one loop, its curve, its checkpoints and its ends."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from learning_problems import PointMass, point_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import DiscriminatorConfig, MSRDConfig
from msrd_ros.learning.harness import (
    CHECKPOINT_FILE,
    PAUSE_S,
    RESULT_FILE,
    Harness,
    Schedule,
    Task,
    iterations,
)
from msrd_ros.learning.method import Learner, Problem
from msrd_ros.learning.methods import find_method
from msrd_ros.learning.rollouts import BatchedCollector

CONFIG = MSRDConfig(
    iterations=3,
    episodes=1,
    discriminator=DiscriminatorConfig(steps=2, batch=8),
    cloning=CloningConfig(steps=3, batch=8),
)


def learner(config: MSRDConfig = CONFIG) -> Learner:
    problem = Problem(config, point_demonstrations(), BatchedCollector(PointMass()), seed=0)
    return find_method("msrd").start(problem)


class Noting(Task):
    """Writes down what it is asked for; wants to stop after so many iterations."""

    def __init__(self, last: int = 100) -> None:
        self.told: list[str] = []
        self._last = last

    def evaluate(self) -> dict[str, Any]:
        self.told.append("evaluate")
        return {"evaluations": self.told.count("evaluate")}

    def at_point(self, harness: Harness) -> None:
        self.told.append(f"point {harness.iteration}")

    def after_iteration(self, harness: Harness) -> None:
        self.told.append(f"iteration {harness.iteration}")
        if harness.iteration >= self._last:
            harness.stop.set()

    def save(self, out: Path) -> dict[str, Any]:
        self.told.append("save")
        return {"mine": 7}


class Diverging:
    """Learns well once."""

    def __init__(self) -> None:
        self.rewards = iter((1.0, float("nan")))

    def iterate(self) -> dict[str, float]:
        return {"reward": next(self.rewards)}


def weights(harness: Harness) -> torch.Tensor:
    return torch.cat([value.flatten() for value in harness.learner.averaged_rewards.state_dict().values()])


def test_a_run_is_cloned_evaluated_and_saved_when_it_is_due(tmp_path: Path) -> None:
    task = Noting()
    harness = Harness(learner(), task, Schedule(evaluate_every=2, checkpoint_every=2, out=tmp_path))
    harness.run()
    assert task.told == [
        "evaluate", "point 0", "iteration 1", "evaluate", "point 2", "iteration 2", "save",
        "evaluate", "point 3", "iteration 3", "save",
    ]  # fmt: skip
    assert [row["iteration"] for row in harness.curve] == [0, 2, 3]
    assert [row["evaluations"] for row in harness.curve] == [1, 2, 3]
    assert 0.0 < harness.curve[0]["seconds"] < harness.curve[1]["seconds"] < harness.seconds
    assert harness.seconds_left == 0.0
    result = json.loads((tmp_path / RESULT_FILE).read_text())
    assert (result["mine"], result["iterations"], result["curve"]) == (7, 3, harness.curve)


def test_a_stopped_run_goes_on_exactly(tmp_path: Path) -> None:
    whole = Harness(learner(), Task())
    whole.run()
    first = Harness(learner(), Noting(last=1), Schedule(1, 0, tmp_path))
    first.run()
    assert first.iteration == 1
    second = Harness(learner(), Task(), Schedule(1, 0, tmp_path))
    assert second.resume() == 1
    assert second.curve == first.curve
    second.run()
    assert second.iteration == 3
    assert [row["iteration"] for row in second.curve] == [0, 1, 2, 3]
    assert torch.equal(weights(second), weights(whole))


def test_a_checkpoint_may_be_asked_for(tmp_path: Path) -> None:
    task = Noting(last=1)
    harness = Harness(learner(), task, Schedule(out=tmp_path))
    harness.checkpoint_wanted.set()
    harness.run()
    assert task.told.count("save") == 2
    assert not harness.checkpoint_wanted.is_set()
    assert (tmp_path / CHECKPOINT_FILE).is_file()


def test_a_paused_run_waits_with_a_checkpoint_and_goes_on_exactly(tmp_path: Path) -> None:
    whole = Harness(learner(), Task())
    whole.run()
    harness = Harness(learner(), Task(), Schedule(out=tmp_path))
    harness.paused.set()
    harness.checkpoint_wanted.set()
    thread = threading.Thread(target=harness.run)
    thread.start()
    end_s = time.monotonic() + 60.0
    while harness.checkpoint_wanted.is_set() and time.monotonic() < end_s:
        time.sleep(0.01)
    time.sleep(4 * PAUSE_S)
    assert (harness.iteration, thread.is_alive()) == (0, True)
    harness.paused.clear()
    thread.join()
    assert (tmp_path / CHECKPOINT_FILE).is_file()
    assert torch.equal(weights(harness), weights(whole))
    # A stop ends a pause as well.
    stopped = Harness(learner(), Task())
    stopped.paused.set()
    stopped.stop.set()
    stopped.run()
    assert stopped.iteration == 0


def test_without_iterations_there_is_cloning_alone() -> None:
    task = Noting()
    Harness(learner(replace(CONFIG, iterations=0)), task, Schedule(evaluate_every=10)).run()
    assert task.told == ["evaluate", "point 0"]


def test_a_figure_that_is_not_finite_ends_the_loop() -> None:
    diverging = iterations(Diverging(), 5)
    assert next(diverging) == (1, {"reward": 1.0})
    with pytest.raises(UserError, match=r"iteration 2: reward is nan; training diverged"):
        next(diverging)


def test_without_a_checkpoint_there_is_nothing_to_go_on_from(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read the checkpoint"):
        Harness(learner(), Task(), Schedule(out=tmp_path)).resume()
