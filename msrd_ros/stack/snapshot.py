"""What can be seen of a running graph from outside: data, as the doctor judges it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rclpy.qos import QoSProfile

from msrd_ros.contract.interface import TOPICS


@dataclass(frozen=True)
class Endpoint:
    """A publisher or a subscription: full names of its node and topic, and what it offers or asks for."""

    node: str
    topic: str
    type_name: str
    publishes: bool
    qos: QoSProfile


@dataclass
class Heard:
    """What came on a topic.

    Attributes
    ----------
    count, seconds
        How many messages, and for how long they were listened for.
    stamp_ns, received_ns
        Of the last one: its header's stamp (None without a header), and wall time of its arrival.
    stamps
        How many stamps were told apart, at most two.
    names
        Sets of joints that messages carried.
    """

    seconds: float = 0.0
    count: int = 0
    stamp_ns: int | None = None
    received_ns: int = 0
    stamps: int = 0
    names: set[tuple[str, ...]] = field(default_factory=set)

    @property
    def rate_hz(self) -> float:
        """Messages a second."""
        return self.count / self.seconds if self.seconds else 0.0


@dataclass(frozen=True)
class Said:
    """A node's last word in /diagnostics."""

    message: str
    values: Mapping[str, str]

    @property
    def waits_for(self) -> str:
        """What it waits for; empty if for nothing."""
        return self.values.get("waits_for", "")


@dataclass(frozen=True)
class Snapshot:
    """A graph as it was while the doctor listened.

    Attributes
    ----------
    domain, discovery_range
        Where was looked, and how far.
    other_domains
        Domains on which something on this machine speaks as well.
    nodes
        Full names, one for each node: a name that stands twice is two nodes.
    parameters
        By node: those that matter for others (robot, mode, checkpoint).
    policies
        By topic: which robot the policies are of that are published on it.
    """

    domain: int
    discovery_range: str
    nodes: tuple[str, ...] = ()
    endpoints: tuple[Endpoint, ...] = ()
    heard: Mapping[str, Heard] = field(default_factory=dict)
    said: Mapping[str, Said] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    policies: Mapping[str, str] = field(default_factory=dict)
    other_domains: tuple[int, ...] = ()

    def publishers(self, topic: str) -> tuple[Endpoint, ...]:
        """Who sends a topic."""
        return tuple(end for end in self.endpoints if end.topic == topic and end.publishes)

    def subscriptions(self, topic: str) -> tuple[Endpoint, ...]:
        """Who listens to a topic."""
        return tuple(end for end in self.endpoints if end.topic == topic and not end.publishes)

    def simulators(self, clock: str) -> tuple[str, ...]:
        """Who sends a clock and is no player of bags: it has a mode."""
        nodes = {end.node for end in self.publishers(clock)}
        return tuple(sorted(name for name in nodes if "mode" in self.parameters.get(name, {})))

    def age_s(self, topic: str) -> float | None:
        """How old the newest stamp of a topic is, by the clock of its namespace or the wall.

        None where that means nothing: nothing was heard, it has no stamp, or bags are played, whose clock is
        their recorder's.
        """
        heard = self.heard.get(topic)
        if heard is None or not heard.stamp_ns or role_of(topic) == "clock":
            return None
        own = f"{namespace_of(topic, role_of(topic)).rstrip('/')}/clock"
        clock = own if self.publishers(own) else "/clock"
        if not self.publishers(clock):
            return (heard.received_ns - heard.stamp_ns) / 1e9
        ticked = self.heard.get(clock)
        if not self.simulators(clock) or ticked is None or ticked.stamp_ns is None:
            return None
        return (ticked.stamp_ns - heard.stamp_ns) / 1e9

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the stack that somebody sends or listens to."""
        return tuple(sorted({end.topic for end in self.endpoints if role_of(end.topic)}))

    @property
    def own_nodes(self) -> tuple[str, ...]:
        """Nodes that speak in /diagnostics, as all of the stack do."""
        return tuple(sorted({end.node for end in self.publishers("/diagnostics")}))


def role_of(topic: str) -> str:
    """The contract's name of a topic in whatever namespace; empty if it has none."""
    fitting = [role for role in TOPICS if topic == role or topic.endswith(f"/{role.lstrip('/')}")]
    return max(fitting, key=len, default="")


def namespace_of(name: str, role: str = "") -> str:
    """Namespace of a node, or of a topic that plays a role; the root is ``/``."""
    inner = role.lstrip("/") if role else name.rpartition("/")[2]
    return name.removesuffix(inner).rstrip("/") or "/"
