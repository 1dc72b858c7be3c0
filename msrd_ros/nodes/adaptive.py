"""Subscriptions that adapt to what publishers offer, as rosbag2's do, and count what goes missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from msrd_ros.nodes.common import steady_timer

ADAPT_PERIOD_S = 0.25


class Received(NamedTuple):
    """A message as the middleware handed it over.

    Attributes
    ----------
    message
        The message, or its bytes from a raw subscription.
    received_ns, sent_ns
        Wall time of reception and of sending in nanoseconds.
    sequence
        The publisher's number of it.
    lost_before
        How many messages of the publisher went missing right before it.
    """

    message: Any
    received_ns: int
    sent_ns: int
    sequence: int
    lost_before: int


class LossCounter:
    """Finds gaps in the sequence numbers of one publisher; a number that goes back is a new publisher."""

    def __init__(self) -> None:
        self.lost = 0
        self._last: int | None = None

    def add(self, sequence: int) -> int:
        """How many messages are missing before this one."""
        gap = 0 if self._last is None or sequence <= self._last else sequence - self._last - 1
        self._last = sequence
        self.lost += gap
        return gap

    def forget(self) -> None:
        """Begin anew with the next number, as after a new subscription."""
        self._last = None


class AdaptiveSubscription:
    """A subscription that is made again when publishers offer less, or more, than it asks for.

    Volatile: what was sent before it was there would be history. For latched topics see `latched`.

    Parameters
    ----------
    node
        The node that subscribes.
    message_type, topic
        What to subscribe to.
    profile
        The contract's quality of service, asked for until a publisher is there; best effort stays so.
    callback
        Takes every message.
    raw
        Hand over bytes instead of messages.
    group
        Which callbacks it goes with; those of the node when None.
    """

    def __init__(
        self,
        node: Node,
        message_type: Any,
        topic: str,
        profile: QoSProfile,
        callback: Callable[[Received], None],
        raw: bool = False,
        group: CallbackGroup | None = None,
    ) -> None:
        self._node = node
        self._message_type = message_type
        self._topic = topic
        self._depth = profile.depth
        self._callback = callback
        self._raw = raw
        self._group = group
        self._counter = LossCounter()
        self._told = False
        self.publishers = 0
        self.reliable = self._may_be_reliable = profile.reliability == ReliabilityPolicy.RELIABLE
        self._subscription = self._subscribe()

    @property
    def lost(self) -> int:
        """Messages that went missing so far."""
        return self._counter.lost

    @property
    def connected(self) -> bool:
        """Whether messages of at least one publisher arrive: matched, not only discovered."""
        publishers: int = self._subscription.get_publisher_count()
        return publishers > 0

    def close(self) -> None:
        """Subscribe no more."""
        self._node.destroy_subscription(self._subscription)

    def adapt(self) -> None:
        """Look at the publishers that are there, and ask for what all of them offer."""
        infos = self._node.get_publishers_info_by_topic(self._subscription.topic_name)
        self.publishers = len(infos)
        if not infos:
            return
        offered = {info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in infos}
        if len(offered) > 1 and not self._told:
            self._told = True
            self._node.get_logger().warning(
                f"topic {self._subscription.topic_name}: its {len(infos)} publishers offer different "
                f"qualities of service; messages may be lost, so let one of them publish it"
            )
        reliable = self._may_be_reliable and all(offered)
        if reliable != self.reliable:
            self.reliable = reliable
            self._node.destroy_subscription(self._subscription)
            self._counter.forget()
            self._subscription = self._subscribe()

    def _subscribe(self) -> Any:
        profile = QoSProfile(
            depth=self._depth,
            reliability=ReliabilityPolicy.RELIABLE if self.reliable else ReliabilityPolicy.BEST_EFFORT,
        )
        # rclpy's annotation knows only callbacks without the message's info.
        take: Any = self._take
        # What asks for no more than anybody offers need not look out for those who offer less.
        look_out = SubscriptionEventCallbacks(use_default_callbacks=self.reliable)
        return self._node.create_subscription(
            self._message_type,
            self._topic,
            take,
            profile,
            callback_group=self._group,
            event_callbacks=look_out,
            raw=self._raw,
        )

    def take_waiting(self) -> None:
        """Hand over what has come in already, before its turn."""
        handle = self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._subscription.msg_type, self._raw)) is not None:
                self._take(*taken)

    def _take(self, message: Any, info: dict[str, Any]) -> None:
        sequence = info["publication_sequence_number"] or 0
        # The numbers of several publishers cannot be told apart, so gaps between them mean nothing.
        lost = self._counter.add(sequence) if sequence and self.publishers <= 1 else 0
        received_ns = info["received_timestamp"] or info["source_timestamp"]
        self._callback(Received(message, received_ns, info["source_timestamp"], sequence, lost))


def hear(
    node: Node, message_type: Any, topic: str, callback: Callable[[Any], None], profile: QoSProfile
) -> AdaptiveSubscription:
    """Subscribe for as long as the node lives, whatever is offered; `callback` takes the messages."""
    subscription = AdaptiveSubscription(
        node, message_type, topic, profile, lambda received: callback(received.message)
    )
    steady_timer(node, ADAPT_PERIOD_S, subscription.adapt)
    return subscription
