"""The thread that trains: what follows a run, and what a stop leaves out."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import cast

from msrd_ros.learning.harness import Harness
from msrd_ros.nodes.training_thread import TrainingThread

WAIT_S = 20.0


class Run:
    """Stands in for a harness."""

    def __init__(self) -> None:
        self.stop, self.paused, self.checkpoint_wanted = (threading.Event() for _ in range(3))
        self.told: list[str] = []

    def run(self) -> None:
        self.told.append("run")


def follow(run: Run, afterwards: Callable[[Callable[[], None]], None]) -> TrainingThread:
    thread = TrainingThread(cast(Harness, run), afterwards)
    thread._thread.join(WAIT_S)
    assert not thread.is_alive
    return thread


def test_what_follows_comes_after_the_run() -> None:
    run = Run()

    def afterwards(look: Callable[[], None]) -> None:
        look()
        run.told.append("more")

    thread = follow(run, afterwards)
    assert (run.told, thread.failure) == (["run", "more"], None)


def test_a_run_that_was_stopped_is_followed_by_nothing() -> None:
    run = Run()
    run.stop.set()
    thread = follow(run, lambda _: run.told.append("more"))
    assert (run.told, thread.failure) == (["run"], None)


def test_a_stop_ends_what_follows_where_it_looks() -> None:
    run = Run()

    def afterwards(look: Callable[[], None]) -> None:
        run.stop.set()
        look()
        run.told.append("more")

    thread = follow(run, afterwards)
    assert (run.told, thread.failure) == (["run"], None)


def test_a_failure_of_what_follows_is_handed_on() -> None:
    def afterwards(_: Callable[[], None]) -> None:
        raise ValueError("no")

    assert isinstance(follow(Run(), afterwards).failure, ValueError)
