"""Listens to /diagnostics while a recipe runs, and remembers each node's last word."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Mapping
from typing import Self

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

SETTLE_S = 1.2
"""A little longer than the nodes' diagnostic period."""


class Monitor:
    """A node on a thread of its own.

    Parameters
    ----------
    environment
        ROS_DOMAIN_ID and discovery settings of the nodes to listen to.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "HOME"):
            os.environ[name] = environment[name]
        self._values: dict[str, dict[str, str]] = {}
        self._context = Context()
        rclpy.init(context=self._context, args=["monitor"])
        self._node = rclpy.create_node("monitor", context=self._context)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="monitor", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._context.try_shutdown()
        self._thread.join(5.0)
        self._node.destroy_node()

    def clear(self) -> None:
        """Forget what was heard."""
        self._values = {}

    def settle(self) -> None:
        """Wait until every node has spoken once more."""
        time.sleep(SETTLE_S)

    def values(self, node: str) -> dict[str, str]:
        """Last figures of a node, as text; empty if it has not been heard.

        Parameters
        ----------
        node
            Its full name; one without a slash is at the root.
        """
        return dict(self._values.get(node if node.startswith("/") else f"/{node}", {}))

    def _take(self, message: DiagnosticArray) -> None:
        for item in message.status:
            self._values[item.name] = {pair.key: pair.value for pair in item.values}

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()
