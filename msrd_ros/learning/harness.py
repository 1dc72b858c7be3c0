"""The one loop of everything that learns in iterations, and what goes with it; a task says what differs.

`iterations` is the bare loop. `Harness` runs a `Learner` from cloning to its last iteration: evaluations and
their curve, checkpoints and exact resuming, a progress bar, stopping on request.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from tqdm import tqdm

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report, write_report
from msrd_ros.learning.checkpoints import load_checkpoint, save_checkpoint
from msrd_ros.learning.method import Learner

CHECKPOINT_FILE = "checkpoint.safetensors"
RESULT_FILE = "training.json"
PAUSE_S = 0.05
"""How often a paused run looks whether it may go on."""


class Iterating(Protocol):
    """Whatever learns in iterations."""

    def iterate(self) -> dict[str, float]:
        """One round of playing and learning; figures by name."""
        ...


def iterations(learner: Iterating, count: int) -> Iterator[tuple[int, dict[str, float]]]:
    """Iterate so many times; yields the number of each, from 1, and its figures.

    Raises
    ------
    UserError
        If a figure is not finite.
    """
    for iteration in range(1, count + 1):
        yield iteration, finite(f"iteration {iteration}", learner.iterate())


def finite(when: str, figures: dict[str, float]) -> dict[str, float]:
    """The figures; raises a `UserError` if one of them is not finite."""
    for name, value in figures.items():
        if not np.isfinite(value):
            raise UserError(
                f"{when}: {name} is {value}; training diverged: lower discriminator.learning_rate, "
                "cloning.learning_rate or trust_region.kl"
            )
    return figures


@dataclass(frozen=True)
class Schedule:
    """How often what is done.

    Attributes
    ----------
    evaluate_every
        Iterations between evaluations, of which one follows cloning and one the last iteration; 0: none.
    checkpoint_every
        Iterations between checkpoints, of which one is written at the end; 0: that one only.
    out
        Folder of checkpoint and result; None: nothing is written.
    """

    evaluate_every: int = 0
    checkpoint_every: int = 0
    out: Path | None = None


class Task:
    """What is particular to a task; by itself nothing is judged, told or written."""

    def evaluate(self) -> dict[str, Any]:
        """Judge the present policies: figures by name, as data for JSON, for the curve."""
        return {}

    def at_point(self, harness: Harness) -> None:
        """At the beginning, also of a resumed run, and after every evaluation."""

    def after_iteration(self, harness: Harness) -> None:
        """After every iteration, its evaluation included."""

    def at_end(self, harness: Harness) -> None:
        """Once the run is over and written."""

    def summary(self, harness: Harness) -> str:
        """A few words for the progress bar."""
        return ""

    def save(self, out: Path) -> dict[str, Any]:
        """Write what is to lie beside a checkpoint; gives more for the result, as data for JSON."""
        return {}


class Harness:
    """Runs a learner; may do so on a thread of its own.

    Parameters
    ----------
    learner
        What learns.
    task
        What is particular.
    schedule
        How often what is done.
    title
        Of the progress bar; None: there is none.

    Attributes
    ----------
    stop, checkpoint_wanted, paused
        Set them from any thread: the run ends, writes a checkpoint, or waits until `paused` is cleared, after
        the present iteration.
    metrics
        Figures of the latest iteration.
    curve
        One row for each evaluation: ``iteration``, ``seconds``, and what the task says.
    seconds, cpu_seconds
        What learning took since this run was begun or resumed, without evaluations.
    """

    def __init__(
        self, learner: Learner, task: Task, schedule: Schedule | None = None, title: str | None = None
    ) -> None:
        self.learner, self.task, self.title = learner, task, title
        self.schedule = schedule or Schedule()
        self.stop = threading.Event()
        self.checkpoint_wanted = threading.Event()
        self.paused = threading.Event()
        self.metrics: dict[str, float] = {}
        self.curve: list[dict[str, Any]] = []
        self.seconds = self.cpu_seconds = 0.0
        self._first = 0

    @property
    def iteration(self) -> int:
        """Iterations that are done."""
        return self.learner.iterations_done

    @property
    def planned(self) -> int:
        """Iterations of the whole run."""
        return self.learner.config.iterations

    @property
    def seconds_left(self) -> float:
        """What the remaining iterations will take, if they are like the ones so far."""
        return self.seconds / max(1, self.iteration - self._first) * (self.planned - self.iteration)

    def resume(self) -> int:
        """Go on from the checkpoint in ``out``; returns the iterations that it had done.

        Raises
        ------
        UserError
            If there is none, or it belongs to another run.
        """
        out = self.schedule.out
        if out is None:
            raise ValueError("only a run with a folder has a checkpoint to go on from")
        load_checkpoint(out / CHECKPOINT_FILE, self.learner)
        result = out / RESULT_FILE
        if result.is_file():
            self.curve = read_report(result).get("curve", [])
        return self.iteration

    def run(self) -> None:
        """Learn until all iterations are done or `stop` is set; what was learned is on disk then."""
        if self.iteration == 0:
            with self._timed():
                finite("cloning", self.learner.clone())
            self._evaluate()
        self._first = self.iteration
        self.task.at_point(self)
        with tqdm(
            total=self.planned,
            initial=self.iteration,
            unit="iteration",
            desc=self.title,
            disable=self.title is None,
        ) as bar:
            while self.iteration < self.planned and self._goes_on():
                with self._timed():
                    self.metrics = finite(f"iteration {self.iteration + 1}", self.learner.iterate())
                self._follow_up()
                bar.update()
                bar.set_postfix_str(self.task.summary(self))
        self._save()
        self.task.at_end(self)

    def _goes_on(self) -> bool:
        """Whether nobody stopped the run; returns once it is not paused."""
        while self.paused.is_set() and not self.stop.wait(PAUSE_S):
            self._save_if_wanted()
        return not self.stop.is_set()

    def _follow_up(self) -> None:
        """What is due after an iteration."""
        schedule, iteration = self.schedule, self.iteration
        if schedule.evaluate_every and (
            iteration % schedule.evaluate_every == 0 or iteration == self.planned
        ):
            self._evaluate()
            self.task.at_point(self)
        self.task.after_iteration(self)
        if schedule.checkpoint_every and iteration % schedule.checkpoint_every == 0:
            self.checkpoint_wanted.set()
        self._save_if_wanted()

    def _evaluate(self) -> None:
        if self.schedule.evaluate_every:
            spent = {"iteration": self.iteration, "seconds": self.seconds}
            self.curve.append({**spent, **self.task.evaluate()})

    def _save_if_wanted(self) -> None:
        if self.checkpoint_wanted.is_set():
            self.checkpoint_wanted.clear()
            self._save()

    def _save(self) -> None:
        """Write checkpoint and result, each whole or not at all."""
        out = self.schedule.out
        if out is None:
            return
        save_checkpoint(out / CHECKPOINT_FILE, self.learner, self.metrics)
        result = {
            **self.task.save(out),
            "seconds": self.seconds,
            "iterations": self.iteration,
            "curve": self.curve,
        }
        write_report(out / RESULT_FILE, result)

    @contextmanager
    def _timed(self) -> Iterator[None]:
        started, started_cpu = time.perf_counter(), time.process_time()
        yield
        self.seconds += time.perf_counter() - started
        self.cpu_seconds += time.process_time() - started_cpu
