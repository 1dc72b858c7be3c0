"""A robot, camera and referee made up for tests: real publishers of the contract's topics."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from msrd_ros.contract.topics import CONTRACT, BagMessage

MATCH_TIMEOUT_S = 20.0
ANSWER_TIMEOUT_S = 20.0
SAFE_RATE_HZ = 3000.0
SENT = ("joint_states", "ball/position", "feed", "strategy", "rally/outcome")


class StrokeSource:
    """Publishes serialised strokes, and hears what the recorder says of them.

    Parameters
    ----------
    node
        The test's own node.
    topics
        What to publish, by relative names of the contract.
    best_effort
        Those of them that a best-effort publisher sends.
    """

    def __init__(
        self,
        node: Node,
        topics: Iterable[str] = (*SENT, "robot_description"),
        best_effort: Iterable[str] = (),
    ) -> None:
        self.node = node
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)
        self.verdicts: list[dict[str, str]] = []
        self.diagnostics: dict[str, str] = {}
        self.publishers = {
            topic: node.create_publisher(
                message_class(CONTRACT[topic].type_name),
                topic,
                QoSProfile(
                    depth=CONTRACT[topic].depth,
                    durability=DurabilityPolicy.TRANSIENT_LOCAL
                    if CONTRACT[topic].latched
                    else DurabilityPolicy.VOLATILE,
                    reliability=ReliabilityPolicy.BEST_EFFORT
                    if topic in best_effort
                    else ReliabilityPolicy.RELIABLE,
                ),
            )
            for topic in topics
        }
        node.create_subscription(DiagnosticArray, "recorder/verdict", self._on_verdict, 100)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def wait_until(
        self, condition: Callable[[], Any], what: str, timeout_s: float = ANSWER_TIMEOUT_S
    ) -> None:
        """Spin until a condition holds."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, f"no {what} in {timeout_s} s"
            self.executor.spin_once(timeout_sec=0.05)

    def wait_for_match(self) -> None:
        """Wait until every publisher has a subscriber, and the verdict a publisher."""
        self.wait_until(
            lambda: (
                all(item.get_subscription_count() for item in self.publishers.values())
                and self.node.count_publishers("recorder/verdict")
            ),
            "recorder",
            MATCH_TIMEOUT_S,
        )

    def send(self, messages: Iterable[BagMessage], rate_hz: float = SAFE_RATE_HZ) -> None:
        """Publish messages one after the other, not faster than a rate."""
        begin = time.monotonic()
        for index, message in enumerate(messages):
            wait_s = begin + index / rate_hz - time.monotonic()
            if wait_s > 0.0:
                time.sleep(wait_s)
            self.publishers[message.topic].publish(message.data)

    def send_in_time(self, messages: Iterable[BagMessage]) -> None:
        """Publish messages at the times that they carry, which must lie ahead on the wall clock."""
        for message in messages:
            wait_s = (message.log_time_ns - time.time_ns()) / 1e9
            if wait_s > 0.0:
                time.sleep(wait_s)
            self.publishers[message.topic].publish(message.data)

    def verdict(self, number: int) -> dict[str, str]:
        """The recorder's verdict on the ball of a number, counted from one."""
        self.wait_until(lambda: len(self.verdicts) >= number, f"verdict {number}")
        return self.verdicts[number - 1]

    def _on_verdict(self, message: DiagnosticArray) -> None:
        (status,) = message.status
        assert status.name == "stroke"
        values = {item.key: item.value for item in status.values}
        self.verdicts.append({**values, "message": status.message, "label": message.header.frame_id})

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "/recorder":
                self.diagnostics = {item.key: item.value for item in status.values}
                self.diagnostics["message"] = status.message


def message_class(type_name: str) -> Any:
    """The class of a message type such as ``sensor_msgs/msg/JointState``."""
    package, _, name = type_name.replace("/", ".").rpartition(".")
    return getattr(importlib.import_module(package), name)
