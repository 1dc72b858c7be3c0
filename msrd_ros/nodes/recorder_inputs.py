"""What the recorder subscribes to: the contract's topics as bytes, and the latched ones it remembers."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from msrd_ros.bags.schemas import describe_type
from msrd_ros.bags.strokes import STATES, Arrival
from msrd_ros.contract.topics import (
    CONTRACT,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    STROKE,
    TF_STATIC,
    BagTopic,
)
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.adaptive import AdaptiveSubscription, Received
from msrd_ros.nodes.latched import LatchedSubscription

STREAMED = STROKE
_MESSAGE_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")
LATCHED = (ROBOT_DESCRIPTION, TF_STATIC)
BACKLOG = 10_000
"""Messages of a topic that may wait for this process: the middleware acknowledges what it holds, then drops
the oldest, and a process that gets no processor time for a second would lose what was delivered to it."""
MOST_LATCHED = 50
"""Latched messages of one topic that a bag carries; /tf_static may come from several publishers."""


class RecorderInputs:
    """The recorder's subscriptions.

    Parameters
    ----------
    node
        The node that subscribes.
    extra_topics
        Further topics: a name of the contract, or NAME=PACKAGE/msg/TYPE.
    take
        Gets every message but the latched ones.

    Raises
    ------
    UserError
        If an extra topic's type is not given, unknown or not installed.
    """

    def __init__(self, node: Node, extra_topics: list[str], take: Callable[[Arrival], None]) -> None:
        self._node = node
        self._take = take
        self._subscriptions: dict[str, AdaptiveSubscription | LatchedSubscription] = {}
        self.topics: dict[str, BagTopic] = {}
        self.latched: dict[str, list[bytes]] = {}
        for role in STREAMED:
            self._open(role, CONTRACT[role].type_name, partial(self._pass_on, role))
        for role in LATCHED:
            self._open(role, CONTRACT[role].type_name, partial(self._remember, role))
        for entry in extra_topics:
            name, _, type_name = entry.partition("=")
            if not type_name and name in CONTRACT:
                type_name = CONTRACT[name].type_name
            if name not in self.topics:
                self._open(name, type_name, partial(self._pass_on, name))

    @property
    def lost(self) -> int:
        """Joint states and ball positions that went missing so far."""
        return sum(self._subscriptions[role].lost for role in STATES)

    @property
    def heard(self) -> tuple[str, ...]:
        """Those of the stroke's topics that somebody publishes."""
        return tuple(role for role in STREAMED if self._subscriptions[role].connected)

    def close(self) -> None:
        """Listen no more."""
        for subscription in self._subscriptions.values():
            subscription.close()

    def adapt(self) -> None:
        """Follow what the publishers offer."""
        for role, subscription in self._subscriptions.items():
            subscription.adapt()
            self.topics[role] = self.topics[role]._replace(reliable=subscription.reliable)

    def _open(self, role: str, type_name: str, callback: Callable[[Received], None]) -> None:
        facts = CONTRACT.get(role)
        latched = facts is not None and facts.latched
        depth = facts.depth if facts else CONTRACT[JOINT_STATES].depth
        # A bag holds the contract's names in the node's namespace; what they are remapped to passes away.
        full_name = self._node.resolve_topic_name(role, only_expand=True)
        self.topics[role] = BagTopic(full_name, type_name, latched=latched, depth=depth)
        try:
            describe_type(type_name)
            message_type = import_message_type(type_name)
        except UserError as error:
            if role in LATCHED:
                return  # the type of /tf_static is part of no wheel
            raise UserError(
                f"parameter extra_topics of {self._node.get_name()}: {role}: {error}; "
                f"write NAME=PACKAGE/msg/TYPE"
            ) from None
        if latched:
            kept = MOST_LATCHED if role == TF_STATIC else depth
            self._subscriptions[role] = LatchedSubscription(
                self._node, message_type, role, callback, kept, raw=True
            )
        else:
            self._subscriptions[role] = AdaptiveSubscription(
                self._node, message_type, role, QoSProfile(depth=BACKLOG), callback, raw=True
            )

    def _pass_on(self, role: str, received: Received) -> None:
        self._take(
            Arrival(
                role,
                received.message,
                received.received_ns,
                received.sent_ns,
                received.sequence,
                received.lost_before,
            )
        )

    def _remember(self, role: str, received: Received) -> None:
        earlier = self.latched.get(role, []) if role == TF_STATIC else []
        newest = [*(data for data in earlier if data != received.message), received.message]
        self.latched[role] = newest[-MOST_LATCHED:]


def import_message_type(type_name: str) -> Any:
    """The class of a message type such as ``nav_msgs/msg/Odometry``.

    A bag may name any type: only classes of messages are imported, from packages that have messages.

    Raises
    ------
    UserError
        If it is no message type's name, or this installation does not have it.
    """
    match = _MESSAGE_TYPE.fullmatch(type_name)
    if match is None:
        raise UserError(f"{type_name!r} is no message type; write PACKAGE/msg/TYPE")
    package, name = match.groups()
    try:
        # Found without running any of the package's code.
        spec = importlib.util.find_spec(package)
        places = spec.submodule_search_locations if spec is not None else None
        if any(Path(place, "msg", "__init__.py").is_file() for place in places or ()):
            found = getattr(importlib.import_module(f"{package}.msg"), name, None)
            if isinstance(found, type) and hasattr(found, "get_fields_and_field_types"):
                return found
    except (ImportError, AttributeError, ValueError):
        pass
    raise UserError(f"message type {type_name!r} is not installed; install its package")
