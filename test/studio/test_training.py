"""The trainer as a child: one at a time, and why one failed."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import EVENT, status
from msrd_ros.studio.training import PROGRESS_TOPIC, Training
from stack import START_TIMEOUT_S, Stack

pytestmark = pytest.mark.processes


def test_nothing_runs_at_first(stack: Stack) -> None:
    training = Training(stack.node)
    assert training.state()["phase"] == ""
    with pytest.raises(UserError, match="no training of this studio"):
        training.ask_to_end()


def test_somebody_elses_trainer_is_seen_and_not_doubled(stack: Stack, tmp_path: Path) -> None:
    training = Training(stack.node)
    trainer = stack.node.create_publisher(DiagnosticArray, PROGRESS_TOPIC, EVENT)
    stack.wait_until(lambda: training.is_elsewhere, "publisher")
    figures = {"iteration": 3, "of": 8, "seconds_left": 4.4, "returned_my-drive": 0.5}
    trainer.publish(DiagnosticArray(status=[status("trainer", "training", figures)]))
    stack.wait_until(lambda: training.state()["iteration"], "progress")
    told = training.state()
    assert (told["phase"], told["run"]) == ("elsewhere", "")
    assert (told["iteration"], told["planned"], told["seconds_left"]) == (3, 8, 4)
    assert told["returned"] == {"my-drive": 0.5}
    with pytest.raises(UserError, match="somebody else's trainer"):
        training.start(tmp_path, {})


def test_a_trainer_that_fails_is_told_with_its_last_words(stack: Stack, tmp_path: Path) -> None:
    training = Training(stack.node)
    run = tmp_path / "drive"
    (run / "bags").mkdir(parents=True)
    training.start(run, {"bags": str(run / "bags"), "iterations": "2", "seed": "0"})
    assert training.state()["phase"] == "begins"
    with pytest.raises(UserError, match="run drive is under way"):
        training.start(run, {})
    stack.wait_until(lambda: not training.runs, "end", START_TIMEOUT_S)
    told = training.state()
    assert told["failed"]
    assert "trainer ended with exit status 2" in told["ended"]
    assert "holds no bags" in told["ended"]
    training.close()


def test_what_up_would_refuse_is_refused(stack: Stack, tmp_path: Path) -> None:
    training = Training(stack.node)
    with pytest.raises(UserError, match="train iterations:=many: give a whole number"):
        training.start(tmp_path, {"iterations": "many"})
    assert training.state()["phase"] == ""
