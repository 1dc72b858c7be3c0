"""Latched inputs, open to everybody: late joiners still get the newest, tools need no special settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from msrd_ros.nodes.adaptive import ADAPT_PERIOD_S, AdaptiveSubscription, Received
from msrd_ros.nodes.common import steady_timer


class LatchedSubscription:
    """Two subscriptions of one topic, as one: transient local for what was sent before, volatile for tools.

    A transient-local subscription never matches a volatile publisher, such as `ros2 topic pub` with its
    defaults; a volatile one never gets what was sent before it was there. What a transient-local publisher
    sends now reaches both, and is handed on once.

    Copies are told by their number and time of sending. Only the message handed on last is remembered: should
    one subscription run ahead of the other, its newest message comes again behind the older one, and counts.

    Parameters
    ----------
    node
        The node that subscribes.
    message_type, topic, depth
        What to subscribe to, and how much of what was sent before is wanted of each publisher.
    callback
        Takes every message.
    raw
        Hand over bytes instead of messages.
    """

    def __init__(
        self,
        node: Node,
        message_type: Any,
        topic: str,
        callback: Callable[[Received], None],
        depth: int = 1,
        raw: bool = False,
    ) -> None:
        self._node = node
        self._callback = callback
        self._last: tuple[int, int] | None = None
        profile = QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # rclpy's annotation knows only callbacks without the message's info.
        take: Any = self._take_earlier
        self._earlier = node.create_subscription(message_type, topic, take, profile, raw=raw)
        self._present = AdaptiveSubscription(
            node, message_type, topic, QoSProfile(depth=depth), self._take, raw=raw
        )

    @property
    def reliable(self) -> bool:
        """Whether all publishers are."""
        reliable: bool = self._present.reliable
        return reliable

    @property
    def lost(self) -> int:
        """Always 0: of a latched topic only the newest counts."""
        return 0

    @property
    def connected(self) -> bool:
        """Whether messages of at least one publisher arrive."""
        return self._present.connected

    def adapt(self) -> None:
        """Follow what the publishers offer."""
        self._present.adapt()

    def close(self) -> None:
        """Subscribe no more."""
        self._node.destroy_subscription(self._earlier)
        self._present.close()

    def _take_earlier(self, message: Any, info: dict[str, Any]) -> None:
        sequence = info["publication_sequence_number"] or 0
        received_ns = info["received_timestamp"] or info["source_timestamp"]
        self._take(Received(message, received_ns, info["source_timestamp"], sequence, 0))

    def _take(self, received: Received) -> None:
        known = received.sent_ns, received.sequence
        if known != self._last:
            self._last = known
            self._callback(received)


def hear_latched(
    node: Node, message_type: Any, topic: str, callback: Callable[[Any], None]
) -> LatchedSubscription:
    """Subscribe to a latched topic for as long as the node lives; `callback` takes its messages."""
    subscription = LatchedSubscription(node, message_type, topic, lambda received: callback(received.message))
    steady_timer(node, ADAPT_PERIOD_S, subscription.adapt)
    return subscription
