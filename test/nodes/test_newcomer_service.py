"""A trainer that runs on: a stroke that the recorder keeps is learned and reaches the executor."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from libraries import copy_of
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.nodes.common import COMMAND, EVENT
from msrd_ros.recordings.curation import Curation
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from stack import Stack

pytestmark = pytest.mark.processes

QUICK = {
    "iterations": 0,
    "evaluation_balls": 1,
    "workers": 1,
    "torch_threads": 1,
    "serve": True,
}


def verdict(path: Path, kept: bool = True) -> DiagnosticArray:
    """What a recorder says of a stroke."""
    values = {"ball_id": "1", "kept": str(kept).lower(), "reason": "", "path": str(path)}
    status = DiagnosticStatus(
        name="stroke", message="kept", values=[KeyValue(key=key, value=text) for key, text in values.items()]
    )
    return DiagnosticArray(status=[status])


def test_a_kept_stroke_is_learned_and_reaches_the_executor_without_a_restart(
    stack: Stack, tmp_path: Path
) -> None:
    out, mine = tmp_path / "run", StrategyLabel("my-push")
    bags = copy_of("subject_01", "forehand-push_001", target=tmp_path / "bags")
    Curation(bags).relabel(bags / "subject_01" / "forehand-push_001", mine)
    bag = bags / "subject_01" / "my-push_001"
    executor = stack.start("executor")
    executor.wait_for_line("ready: lockstep, no policies yet")
    stack.start_simulator(show=False)
    trainer = stack.start("trainer", **QUICK, out=out)
    said = stack.node.create_publisher(DiagnosticArray, "recorder/verdict", EVENT)
    trainer.wait_for_line("every stroke that the recorder keeps is learned from now on", 300.0)
    stack.wait_until(said.get_subscription_count, "trainer")
    stack.wait_until(lambda: stack.diagnosed("executor")["policies"], "first policies", 60.0, executor)
    said.publish(verdict(tmp_path / "nowhere"))
    said.publish(verdict(bag, kept=False))
    said.publish(verdict(bag))
    trainer.wait_for_line("not learned: .*nowhere", 60.0)
    trainer.wait_for_line("taken: my-push_001 .*; played as my-push", 200.0)
    learned = StrokePolicies.load(out / "policies.safetensors")
    assert mine in learned.labels
    stack.wait_until(
        lambda: stack.diagnosed("executor")["policies"] == learned.digest, "new policies", 60.0, executor
    )
    told = stack.diagnosed("trainer")
    assert told["message"] == "learning from newcomers"
    assert (told["taken"], told["refused"]) == ("1", "1")
    # What the robot itself played teaches nothing.
    executor.stop()
    command = stack.node.create_publisher(JointTrajectory, "joint_command", COMMAND)
    stack.wait_until(command.get_subscription_count, "who hears commands")
    command.publish(JointTrajectory(header=Header(frame_id="my-push")))

    def is_left_alone() -> bool:
        said.publish(verdict(bag))
        return stack.diagnosed("trainer")["played_by_robot"] != "0"

    stack.wait_until(is_left_alone, "a stroke of the robot's own", 30.0, trainer)
