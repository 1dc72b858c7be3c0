"""Where balls are to land: what the executor takes, what it refuses, and what it says of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from rclpy.qos import QoSProfile

from live_executor import LiveExecutor, live_executor
from made_up_policies import made_up_policies
from msrd_ros.nodes.common import LATCHED
from msrd_ros.nodes.messages import target_from_message, target_to_message
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.reach import Reach
from stack import Stack, one_line

LABELS = ALL_LABELS[:2]
HITS = np.array([[True, True], [True, False]])
REACH = replace(Reach.grid([0.4, 0.8], [-0.2, 0.2]), hits=HITS)
POLICIES = made_up_policies(LABELS, reach=REACH)
STAMP = PointStamped().header.stamp


@pytest.fixture
def arm(domain_id: int) -> Iterator[LiveExecutor]:
    """In lockstep, in its ready pose, with policies that take a target."""
    with live_executor(domain_id) as one:
        one.policies(POLICIES.to_bytes())
        one.make_ready(LABELS[0])
        yield one


def tell(arm: LiveExecutor, x_m: float, y_m: float, frame: str = "world") -> None:
    message = target_to_message(np.array([x_m, y_m]), STAMP)
    message.header.frame_id = frame
    arm.node._on_target(message)
    arm.tick()


def told(arm: LiveExecutor) -> tuple[str, str]:
    values = arm.node.diagnose()[1]
    return str(values["target"]), str(values["target_refused"])


def test_a_target_is_said_in_diagnostics_until_it_is_taken_back(arm: LiveExecutor) -> None:
    assert told(arm) == ("", "")
    tell(arm, 0.5, -0.1)
    assert told(arm) == ("x 0.500, y -0.100 m", "")
    tell(arm, 0.0, 0.0, frame="")
    assert told(arm) == ("", "")
    assert arm.said == []


def test_strokes_go_elsewhere_with_another_target(arm: LiveExecutor) -> None:
    paths = []
    for x_m, y_m in ((0.3, -0.2), (0.3, 0.2), (0.3, -0.2)):
        arm.make_ready(LABELS[0])
        tell(arm, x_m, y_m)
        arm.swing(10)
        paths.append(arm.position.copy())
        for _ in range(200):
            arm.tick()
    np.testing.assert_array_equal(paths[0], paths[2])
    assert not np.allclose(paths[0], paths[1])


@pytest.mark.parametrize(
    ("point", "frame", "why"),
    [
        (
            (0.8, 0.2),
            "world",
            "is out of reach of forehand-push; the nearest that is in reach is x 0.600, y 0.200 m",
        ),
        (
            (1.5, 0.0),
            "world",
            "not on the far half of the table; the nearest point that is on it is x 1.370, y 0.000 m",
        ),
        (
            (-0.5, 0.1),
            "world",
            "not on the far half of the table; the nearest point that is on it is x 0.000, y 0.100 m",
        ),
        ((float("nan"), 0.0), "world", "the point is not finite; give x and y in m"),
        ((0.4, 0.0), "base", "frame 'base' is unknown; give the point in frame 'world'"),
    ],
)
def test_what_is_refused_is_named_once_and_leaves_no_target(
    arm: LiveExecutor, point: tuple[float, float], frame: str, why: str
) -> None:
    tell(arm, 0.5, -0.1)
    tell(arm, *point, frame=frame)
    target, refusal = told(arm)
    assert target == ""
    assert why in refusal
    for _ in range(3):
        arm.tick()
    assert len(arm.said) == 1
    assert why in arm.said[0]
    assert arm.node.diagnose()[1]["refused"] == 1
    tell(arm, 0.5, -0.1)
    assert told(arm) == ("x 0.500, y -0.100 m", "")


def test_policies_without_targets_say_so_and_play(arm: LiveExecutor) -> None:
    arm.policies(made_up_policies(LABELS).to_bytes())
    arm.tick()
    tell(arm, 0.5, -0.1)
    assert "the policy of forehand-push takes no target" in told(arm)[1]
    arm.make_ready(LABELS[0])
    arm.swing(5)


def test_how_high_a_point_is_does_not_count() -> None:
    message = target_to_message(np.array([0.5, 0.1]), STAMP)
    message.point.z = 5.0
    read = target_from_message(message)
    assert read is not None
    np.testing.assert_array_equal(read, [0.5, 0.1])
    assert target_from_message(target_to_message(None, STAMP)) is None


@pytest.mark.processes
def test_targets_come_from_latched_and_from_volatile_publishers_and_are_measured(
    stack: Stack, tmp_path: Path
) -> None:
    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(POLICIES.to_bytes())
    stack.start_simulator(seed=2)
    latched = stack.node.create_publisher(PointStamped, "target", LATCHED)
    latched.publish(target_to_message(np.array([0.4, -0.2]), STAMP))
    stack.start("executor", checkpoint=checkpoint).wait_for_line("ready: lockstep")

    def aims_at(text: str) -> bool:
        return stack.diagnostics.get("executor", {}).get("target") == text

    evaluator = stack.start("evaluator", labels=f"[{LABELS[0]}]", balls=1)
    stack.wait_until(lambda: aims_at("x 0.400, y -0.200 m"), "the latched target")
    volatile = stack.node.create_publisher(PointStamped, "target", QoSProfile(depth=10))
    stack.wait_until(volatile.get_subscription_count, "target")
    volatile.publish(target_to_message(np.array([0.4, 0.1]), STAMP))
    stack.wait_until(lambda: aims_at("x 0.400, y 0.100 m"), "the volatile target")
    assert evaluator.wait(90.0) == 0, evaluator.output

    report = tmp_path / "report.json"
    measuring = stack.start("evaluator", checkpoint=checkpoint, targets=True, balls=1, report=report, seed=1)
    assert measuring.wait(90.0) == 0, measuring.output
    assert '"targets": [' in report.read_text()
    alone = stack.start("evaluator", targets=True, balls=1)
    assert "parameter targets: give the checkpoint, which says what is in reach" in one_line(
        alone, "evaluator"
    )
