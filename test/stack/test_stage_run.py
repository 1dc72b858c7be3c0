"""Stages: started in order, ended the other way round, over when they should be; who is lost comes again."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import pytest

from msrd_ros.stack import stage_run
from msrd_ros.stack.processes import NodeLostError, NodeProcess
from msrd_ros.stack.sets import NodeCall, Part, Stage
from msrd_ros.stack.stage_run import MOST_AT_ONCE, StageRun

STAGE = Stage(
    "play",
    "Play",
    (
        NodeCall("simulator"),
        NodeCall("player", part=Part.FINISHES),
        NodeCall("evaluator", part=Part.ENDS),
    ),
)


class MadeUpProcess:
    """Ends when it is told to."""

    def __init__(self, name: str, journal: list[str]) -> None:
        self.name, self._journal = name, journal
        self.exit_status: int | None = None
        self.ran_s = 0.0
        journal.append(f"start {name}")

    def describe_end(self) -> str:
        return f"{self.name} ended with {self.exit_status}"

    def stop(self) -> None:
        self._journal.append(f"stop {self.name}")
        self.exit_status = 0


class MadeUpStage:
    """A stage run on made-up processes; `then` happens one after the other whenever it looks."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *then: Callable[[MadeUpStage], None]) -> None:
        self.journal: list[str] = []
        self.told: list[str] = []
        self.processes: dict[str, MadeUpProcess] = {}
        self.now_s = 0.0
        self._then = list(then)
        monkeypatch.setattr(stage_run, "time", self)

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, pause_s: float) -> None:
        self.now_s += pause_s
        if self._then:
            self._then.pop(0)(self)

    def run(self, respawn: bool = False) -> None:
        with StageRun(STAGE, self._start, self.told.append, respawn) as run:
            run.wait()

    def _start(self, call: NodeCall) -> NodeProcess:
        self.processes[call.executable] = MadeUpProcess(call.executable, self.journal)
        return cast(NodeProcess, self.processes[call.executable])


def end(name: str, status: int) -> Callable[[MadeUpStage], None]:
    def step(stage: MadeUpStage) -> None:
        stage.processes[name].exit_status = status

    return step


def wait(stage: MadeUpStage) -> None:
    stage.now_s += 100.0


def test_a_stage_ends_with_the_node_that_ends_it_and_others_may_finish_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = MadeUpStage(monkeypatch, end("player", 0), wait, end("evaluator", 0))
    stage.run()
    assert stage.journal == [
        "start simulator",
        "start player",
        "start evaluator",
        "stop evaluator",
        "stop player",
        "stop simulator",
    ]
    assert stage.told == ["ends simulator"]


@pytest.mark.parametrize(("name", "status"), [("simulator", 0), ("player", 1), ("evaluator", -9)])
def test_a_node_that_is_lost_ends_all(name: str, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = MadeUpStage(monkeypatch, end(name, status))
    with pytest.raises(NodeLostError, match=f"{name} ended with {status}"):
        stage.run()
    assert [line for line in stage.journal if "stop" in line][-1] == "stop simulator"


def test_a_node_that_is_lost_is_started_again_after_a_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    def look(stage: MadeUpStage) -> None:
        assert stage.journal.count("start simulator") == 1

    stage = MadeUpStage(monkeypatch, end("simulator", -9), look, look, wait, wait, end("evaluator", 0))
    stage.run(respawn=True)
    assert stage.journal.count("start simulator") == 2
    assert stage.told[0] == "simulator ended with -9; it is started again in 1 s"


def test_a_node_that_ends_at_once_every_time_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = MadeUpStage(monkeypatch, *[end("simulator", 2), wait] * 20)
    with pytest.raises(NodeLostError, match=f"{MOST_AT_ONCE} times in a row and is not started again"):
        stage.run(respawn=True)
    assert stage.journal.count("start simulator") == MOST_AT_ONCE
    pauses = [line.rpartition(" in ")[2] for line in stage.told[:-1]]
    assert pauses == ["1 s", "2 s", "4 s", "8 s", "16 s"]


def test_a_node_that_had_worked_for_a_while_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    def work(stage: MadeUpStage) -> None:
        stage.processes["simulator"].ran_s = 1000.0

    stage = MadeUpStage(monkeypatch, *[work, end("simulator", -9), wait] * 9, end("evaluator", 0))
    stage.run(respawn=True)
    assert {line.rpartition(" in ")[2] for line in stage.told[:-1]} == {"1 s"}


def test_what_was_started_ends_where_the_next_cannot_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = MadeUpStage(monkeypatch)

    def start(call: NodeCall) -> NodeProcess:
        if call.executable == "evaluator":
            raise OSError("no more processes")
        return stage._start(call)

    with pytest.raises(OSError, match="no more"), StageRun(STAGE, start, stage.told.append):
        pass
    assert stage.journal[-2:] == ["stop player", "stop simulator"]
