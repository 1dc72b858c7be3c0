"""Ticks over topics in lockstep: the ball wakes nobody alone, and any order of the two makes a tick."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import JointState

from msrd_ros.nodes.common import STATE
from msrd_ros.nodes.messages import to_stamp
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.loading import default_robot

PERIOD_NS = 20_000_000


class Table:
    """Tells ticks, and takes what is made of them."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.robot = default_robot()
        self.ticks: list[TickInput] = []
        self.repeated = 0
        self.turns = 0
        self.inputs = TickInputs(node, self.robot, True, self.ticks.append, self._repeat, self._refuse)
        self._ball = node.create_publisher(PointStamped, "ball/position", STATE)
        self._joints = node.create_publisher(JointState, "joint_states", STATE)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self.spin_until(lambda: min(p.get_subscription_count() for p in (self._ball, self._joints)) > 0)

    def close(self) -> None:
        self.inputs.close()
        self._executor.shutdown()

    def ball(self, number: int) -> None:
        message = PointStamped()
        message.header.stamp = to_stamp(number * PERIOD_NS)
        message.point.x = float(number)
        self._ball.publish(message)

    def joints(self, number: int) -> None:
        home = self.robot.home_rad.tolist()
        message = JointState(name=list(self.robot.joint_names), position=home, velocity=[0.0] * len(home))
        message.header.stamp = to_stamp(number * PERIOD_NS)
        self._joints.publish(message)

    def spin(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.05)

    def spin_until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < deadline
            self._executor.spin_once(timeout_sec=0.05)

    def _repeat(self) -> None:
        self.repeated += 1

    def _refuse(self, error: Exception) -> None:
        raise error


@pytest.fixture
def table(ros_node: Node) -> Iterator[Table]:
    made = Table(ros_node)
    yield made
    made.close()


def test_ball_and_joints_make_a_tick_in_either_order(table: Table) -> None:
    table.ball(1)
    table.joints(1)
    table.spin_until(lambda: len(table.ticks) == 1)
    table.joints(2)
    table.spin(0.3)
    assert len(table.ticks) == 1  # its ball has not come
    table.ball(2)
    table.spin_until(lambda: len(table.ticks) == 2)
    for number, tick in enumerate(table.ticks, 1):
        assert tick.time_ns == tick.ball_stamp_ns == number * PERIOD_NS
        np.testing.assert_array_equal(tick.ball_position, [number, 0.0, 0.0])


def test_a_ball_alone_wakes_nobody(table: Table) -> None:
    table.ball(1)
    table.spin(0.3)
    assert "ball/position" in " ".join(table.inputs.missing)
    table.joints(1)
    table.spin_until(lambda: len(table.ticks) == 1)
    assert table.inputs.missing == []


def test_what_is_asked_again_is_answered_again(table: Table) -> None:
    for number in (1, 1, 2):
        table.ball(number)
        table.joints(number)
        table.spin(0.2)
    assert [tick.time_ns // PERIOD_NS for tick in table.ticks] == [1, 2]
    assert table.repeated == 1


def test_lockstep_hears_reliable_publishers_without_acknowledging(table: Table) -> None:
    table.spin(0.6)  # subscriptions adapt to what is offered
    for topic in ("ball/position", "joint_states"):
        (info,) = table.node.get_subscriptions_info_by_topic(topic)
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
