"""One simulator, one arm: a second one ends, nothing is measured of two, a restarted one is measured."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from made_up_policies import made_up_policies
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.core.resources import shipped_bags
from msrd_ros.nodes.common import EVENT, STATE
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from stack import Stack, one_line

pytestmark = pytest.mark.processes

LABELS = ALL_LABELS[:1]


def test_who_may_speak(stack: Stack, tmp_path: Path) -> None:
    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(made_up_policies(LABELS).to_bytes())
    first = stack.start_simulator(seed=2, show=False)
    executor = stack.start("executor", checkpoint=checkpoint)
    executor.wait_for_line("ready: lockstep")

    # A forgotten simulator, a bag that is played beside an arm: they end, the first goes on. One after the
    # other: a simulator that starts slowly would take the player for the one that was there before.
    second = stack.start("simulator", seed=3)
    line = one_line(second, "simulator")
    assert "another node already decides rallies on /rally/outcome (/simulator); stop it first" in line
    player = stack.start("player", bags=f"[{shipped_bags()}]", wait_s=3.0)
    line = one_line(player, "player")
    assert "an arm already speaks on /joint_states (right_j0, right_j1" in line
    first.require_running()

    # Somebody else who decides rallies: nothing is measured, and nothing reported.
    other = stack.node.create_publisher(DiagnosticArray, "rally/outcome", EVENT)
    report = tmp_path / "none.json"
    evaluator = stack.start("evaluator", balls=2, seed=1, checkpoint=checkpoint, report=report)
    line = one_line(evaluator, "evaluator")
    told = "2 nodes decide rallies on /rally/outcome (/simulator, /test_observer)"
    assert told in line, f"{first.output}\n{executor.output}\n{evaluator.output}"
    assert not report.exists()
    stack.node.destroy_publisher(other)

    # Its time begins anew: what the executor knew of the old one does not count.
    def measure(name: str) -> int:
        report = tmp_path / f"{name}.json"
        evaluator = stack.start("evaluator", balls=2, seed=1, checkpoint=checkpoint, report=report)
        assert evaluator.wait(120.0) == 0, evaluator.output
        return int(json.loads(report.read_text())["labels"][str(LABELS[0])]["struck"])

    struck = measure("before")
    late_ns = stamp_to_ns(newest(stack).header.stamp)
    first.kill()
    again = stack.start_simulator(seed=2, show=False)
    assert stamp_to_ns(newest(stack).header.stamp) < late_ns
    assert measure("after") == struck
    executor.wait_for_line("starts afresh")
    assert again.stop() == 0


def newest(stack: Stack) -> JointState:
    """A joint state that comes in now."""
    heard: list[JointState] = []
    subscription = stack.node.create_subscription(JointState, "joint_states", heard.append, STATE)
    stack.wait_until(lambda: heard, "joint_states")
    stack.node.destroy_subscription(subscription)
    return heard[-1]
