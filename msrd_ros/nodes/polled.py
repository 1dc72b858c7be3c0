"""Topics that are looked at now and then, however fast they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy


class Unhurried(CallbackGroup):
    """Wakes the executor only while it is wanted; what comes meanwhile can be taken.

    Parameters
    ----------
    wanted
        Whether it is; never by default.
    """

    def __init__(self, wanted: Callable[[], bool] = lambda: False) -> None:
        super().__init__()
        self._wanted = wanted

    def can_execute(self, entity: Any) -> bool:
        """Only while it is wanted."""
        return self._wanted()

    def beginning_execution(self, entity: Any) -> bool:
        """Only while it is wanted."""
        return self._wanted()

    def ending_execution(self, entity: Any) -> None:
        """Nothing is held."""


class PolledTopic:
    """The newest messages of a topic, taken when somebody wants to see them.

    In lockstep ticks come as fast as the machine allows; a callback for each would slow down those who
    have to answer them, on the same processor.

    Parameters
    ----------
    node
        Whose subscription it is.
    message_type, topic
        What to subscribe to; publishers of any reliability are heard.
    depth
        How many of the newest messages are kept.
    """

    def __init__(self, node: Node, message_type: Any, topic: str, depth: int = 1) -> None:
        profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._depth = depth
        self._subscription = node.create_subscription(
            message_type, topic, lambda _: None, profile, callback_group=Unhurried()
        )

    def take(self) -> list[Any]:
        """What has come since the last time, oldest first, at most `depth` messages."""
        found: list[Any] = []
        with self._subscription.handle:
            while len(found) < self._depth:
                taken = self._subscription.handle.take_message(self._subscription.msg_type, False)
                if taken is None:
                    break
                found.append(taken[0])
        return found
