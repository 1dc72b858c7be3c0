"""Latched inputs hear everybody: late, early, with tools' default settings; each message once."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from msrd_ros.nodes.latched import LatchedSubscription

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
DEFAULT = QoSProfile(depth=10)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class Listener:
    """A latched subscription, and what it heard."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.heard: list[str] = []
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)
        self.subscription = LatchedSubscription(
            node, Header, "strategy", lambda received: self.heard.append(received.message.frame_id)
        )

    def spin_until(self, condition: Callable[[], object]) -> None:
        deadline_s = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < deadline_s, self.heard
            self.executor.spin_once(timeout_sec=0.05)
            self.subscription.adapt()


@pytest.fixture
def listener(ros_node: Node) -> Listener:
    return Listener(ros_node)


def publish(listener: Listener, publisher: Publisher, text: str) -> None:
    """Publish, and wait until it is heard and a later message is, so that copies would have come, too."""
    publisher.publish(Header(frame_id=text))
    listener.spin_until(lambda: text in listener.heard)


def test_what_was_sent_before_is_heard_once(ros_node: Node) -> None:
    ros_node.create_publisher(Header, "strategy", LATCHED).publish(Header(frame_id="early"))
    listener = Listener(ros_node)
    listener.spin_until(lambda: listener.heard)
    assert listener.heard == ["early"]


@pytest.mark.parametrize("profile", [LATCHED, DEFAULT, BEST_EFFORT])
def test_every_kind_of_publisher_is_heard_once(listener: Listener, profile: QoSProfile) -> None:
    publisher = listener.node.create_publisher(Header, "strategy", profile)
    listener.spin_until(lambda: listener.subscription.connected)
    for number in range(3):
        publish(listener, publisher, f"stroke-{number}")
    assert listener.heard == [f"stroke-{number}" for number in range(3)]


def test_a_tool_is_heard_beside_a_latched_publisher_and_the_last_word_counts(listener: Listener) -> None:
    node = listener.node
    latched, tool = (node.create_publisher(Header, "strategy", profile) for profile in (LATCHED, DEFAULT))
    listener.spin_until(lambda: latched.get_subscription_count() == 2 and tool.get_subscription_count() == 1)
    for publisher, text in ((latched, "a"), (tool, "b"), (latched, "a"), (tool, "a"), (tool, "c")):
        heard = len(listener.heard)
        publisher.publish(Header(frame_id=text))
        listener.spin_until(lambda heard=heard: len(listener.heard) > heard)  # type: ignore[misc]
    assert listener.heard == ["a", "b", "a", "a", "c"]
