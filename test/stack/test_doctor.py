"""The doctor at a running stack: faults of several kinds one after the other, and nothing in the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header, UInt8MultiArray

from made_up_policies import made_up_policies
from msrd_ros.__main__ import main as command
from msrd_ros.nodes.common import LATCHED
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.stack.doctor import main
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from stack import Stack

pytestmark = pytest.mark.processes

LABEL = ALL_LABELS[0]
PATIENCE = 5
COMPILING_S = 180.0


class Patient:
    """A stack, what the doctor finds in it, and its nodes' parameters."""

    def __init__(self, stack: Stack, capsys: pytest.CaptureFixture[str]) -> None:
        self.stack, self._capsys = stack, capsys

    def examine(self) -> tuple[int, dict[str, Any]]:
        code = main(["--domain", str(self.stack.domain_id), "--json", "--wait", "4"])
        return code, json.loads(self._capsys.readouterr().out)

    def require(self, *wanted: str) -> None:
        """The doctor finds all of this; on a loaded machine it may have to look again."""
        for _ in range(PATIENCE):
            code, seen = self.examine()
            assert code == 1
            found = "\n".join(f"{finding['what']} -> {finding['remedy']}" for finding in seen["findings"])
            missing = [text for text in wanted if text not in found]
            if not missing:
                return
        raise AssertionError(f"{missing} not in\n{found}")

    def let_go(self) -> dict[str, Any]:
        """The doctor finds nothing, and has heard the arm meanwhile; what it saw."""
        for _ in range(PATIENCE):
            code, seen = self.examine()
            assert (code == 0) == (seen["findings"] == [])
            if code == 0 and seen["topics"]["/joint_states"]["rate_hz"] is not None:
                return seen
        raise AssertionError(seen)

    def set(self, node: str, **values: object) -> str:
        """Set a node's parameters through its service; why not, empty if it was done."""
        wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        one = len(wanted) == 1
        kind: Any = SetParameters if one else SetParametersAtomically
        name = "set_parameters" if one else "set_parameters_atomically"
        answer = self.stack.call(kind, f"{node}/{name}", kind.Request(parameters=wanted))
        result = answer.results[0] if one else answer.result
        return "" if result.successful else str(result.reason)


def test_faults_are_found_and_a_healthy_stack_is_let_go(
    stack: Stack, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    patient, node = Patient(stack, capsys), stack.node
    code, seen = patient.examine()
    assert (code, seen["domain"]) == (1, stack.domain_id)
    assert "no node of the stack is on domain" in seen["findings"][0]["what"]

    simulator = stack.start_simulator()
    stack.wait_until(lambda: "waits_for" in stack.diagnosed("simulator"), "what the simulator waits for")
    patient.require("the clock of /simulator stands: it waits for a joint_command: start an executor")

    deaf = node.create_publisher(
        Odometry, "feed", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    camera = node.create_publisher(PointStamped, "ball/position", 10)
    patient.require(
        "/simulator cannot hear /feed from /test_observer: ",
        "/ball/position has 2 sources: /simulator, /test_observer -> stop all but one",
    )
    node.destroy_publisher(deaf)
    node.destroy_publisher(camera)
    stack.wait_until(lambda: node.count_publishers("ball/position") == 1, "the end of the second camera")

    wrong_arm = stack.start("executor", robot="ur10e")
    wrong_arm.wait_for_line("ready: lockstep", COMPILING_S)
    policy = node.create_publisher(UInt8MultiArray, "policy", LATCHED)
    policy.publish(bytes_to_message(made_up_policies([LABEL]).to_bytes()))
    patient.require(
        "/executor is for ur10e, but /joint_states lacks shoulder_pan_joint",
        "/executor is for ur10e: topic /policy: is of the robot sawyer, not ur10e",
    )
    wrong_arm.stop()
    node.destroy_publisher(policy)
    stack.wait_until(lambda: not node.count_publishers("joint_command"), "end of the executor")

    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(made_up_policies([LABEL]).to_bytes())
    executor = stack.start("executor", checkpoint=checkpoint)
    executor.wait_for_line("waits for a strategy: publish one on topic strategy", COMPILING_S)
    patient.require("/executor waits for a strategy: publish one on topic strategy (since ")

    # As `ros2 topic pub -1` does: volatile and reliable.
    tool = node.create_publisher(Header, "strategy", 10)
    stack.wait_until(tool.get_subscription_count, "executor and simulator")
    tool.publish(Header(frame_id=str(LABEL)))
    stack.wait_until(lambda: stack.diagnosed("executor").get("strategy") == str(LABEL), "strategy")
    assert stack.diagnosed("simulator")["strategy"] == str(LABEL)
    stack.wait_until(lambda: "waits_for" not in stack.diagnosed("executor"), "the end of waiting")
    seen = patient.let_go()
    assert seen["nodes"]["/executor"]["parameters"]["robot"] == "sawyer"
    assert seen["topics"]["/joint_states"]["publishers"] == ["/simulator"]
    assert seen["topics"]["/joint_states"]["rate_hz"] > 0.0

    # What is accepted has an effect; what has none is refused.
    assert patient.set("executor", enabled=False) == ""
    patient.require("leave to move: call ~/enable")
    assert stack.set("executor/enable", True).success
    assert patient.set("executor", enabled="no").startswith(
        "parameter enabled of executor: 'no' has the wrong"
    )
    assert "can only be set when it starts: with --ros-args -p checkpoint" in patient.set(
        "executor", checkpoint="/nonexistent"
    )
    assert patient.set("simulator", mode="banana").startswith("parameter mode of simulator can only be set")
    assert "0.5 is out of range; give a value from 0.0 to 0.1 m" in patient.set(
        "simulator", camera_noise_m=0.5
    )
    assert patient.set("simulator", camera_noise_m=0.01, spread="wide") == ""
    assert "'huge' is unknown; use one of" in patient.set("simulator", camera_noise_m=0.0, spread="huge")
    assert executor.stop() == simulator.stop() == 0


@pytest.mark.parametrize("arguments", [["--wait", "0"], ["--wait", "soon"], ["--domain", "900"], ["--fast"]])
def test_a_wrong_call_ends_with_two(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code = command(["doctor", *arguments])
    except SystemExit as left:
        code = int(str(left.code))
    assert code == 2
    captured = capsys.readouterr()
    assert arguments[-1] in captured.err
    assert captured.out == ""
