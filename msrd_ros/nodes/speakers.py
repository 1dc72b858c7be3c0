"""Who may speak: one simulator, one executor, one arm. /diagnostics tell which of our nodes are alive."""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.adaptive import AdaptiveSubscription, Received
from msrd_ros.nodes.common import INSTANCE, STATE, UP_S, StackNode, steady_timer
from msrd_ros.nodes.parameter_files import NODES
from msrd_ros.nodes.sources import FORGET_S

START_UP_S = 3.5
"""How long a starting node looks for another one that does its work already."""
LOOK_PERIOD_S = 0.1
TIE_S = 0.2
"""Who is older cannot be told closer: messages take their time."""
UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""What the graph calls a node whose topics have been found and whose name has not; soon it has."""


@dataclass
class Voice:
    """One process that speaks under a node's name: when it was heard first and last, and since when it is up.

    Times in s, of the listener's steady clock.
    """

    first_s: float
    last_s: float
    up_since_s: float


class Speakers:
    """The nodes of the package that are alive, by what they say of themselves once a second.

    The graph still shows a node that was killed for some 20 s; what has died says nothing.

    Parameters
    ----------
    node
        Who listens.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._voices: defaultdict[str, dict[str, Voice]] = defaultdict(dict)
        profile = QoSProfile(depth=100)
        self._subscription = AdaptiveSubscription(
            node, DiagnosticArray, "/diagnostics", profile, self._on_diagnostics
        )

    def close(self) -> None:
        """Listen no more."""
        self._subscription.close()

    def voices(self, name: str) -> dict[str, Voice]:
        """The processes of that full name that have spoken lately, by their instance."""
        now_s = time.monotonic()
        return {key: one for key, one in self._voices[name].items() if now_s - one.last_s <= FORGET_S}

    def publishers(self, topic: str) -> list[str]:
        """Full names of all who publish a topic, whether alive or not; sorted."""
        infos = self._node.get_publishers_info_by_topic(topic)
        return sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos)

    def side_by_side(self, topic: str) -> list[str]:
        """Those who publish a topic if two or more of them are alive; empty otherwise."""
        names = self.publishers(topic)
        alive = 0
        for name in set(names):
            if name.rpartition("/")[2] not in (*NODES, UNKNOWN):
                alive += 1
                continue
            voices = list(self.voices(name).values())
            # One that was started in the place of a killed one is not beside it.
            newest_s = max((one.first_s for one in voices), default=0.0)
            alive += sum(one.last_s >= newest_s for one in voices)
        return names if alive > 1 else []

    def _on_diagnostics(self, received: Received) -> None:
        now_s = time.monotonic()
        for item in received.message.status:
            values = {pair.key: pair.value for pair in item.values}
            try:
                up_since_s = now_s - float(values.get(UP_S, 0.0))
            except ValueError:
                continue  # of somebody else
            voices = self._voices[item.name]
            instance = values.get(INSTANCE, "")
            first_s = voices[instance].first_s if instance in voices else now_s
            voices[instance] = Voice(first_s, now_s, up_since_s)
            for gone in [key for key, one in voices.items() if now_s - one.last_s > FORGET_S]:
                del voices[gone]


class SoleSpeaker:
    """Ends a starting node if another one that is alive and older publishes what it is about to.

    Parameters
    ----------
    node
        Who starts.
    topic
        What only one node may publish.
    does
        What the other one does, for the error: such as ``commands``.
    remedy
        What to do about it.
    """

    def __init__(self, node: StackNode, topic: str, does: str, remedy: str) -> None:
        self._node, self._topic, self._does, self._remedy = node, topic, does, remedy
        self._speakers = Speakers(node)
        self._started_s = time.monotonic()
        self._timer = steady_timer(node, LOOK_PERIOD_S, self._look)

    @property
    def is_doubtful(self) -> bool:
        """Whether another one is known and it is not yet clear whether it is alive."""
        return not self._timer.is_canceled() and bool(self.others)

    @property
    def others(self) -> list[str]:
        """Full names of all others who publish it, alive or not."""
        names = self._speakers.publishers(self._topic)
        own = self._node.get_fully_qualified_name()
        if own in names:
            names.remove(own)
        return names

    def _look(self) -> None:
        alive = [
            name
            for name in self.others
            if name.rpartition("/")[2] not in (*NODES, UNKNOWN) or self._speaks_longer(name)
        ]
        if alive:
            raise UserError(
                f"another node already {self._does} {self._node.resolve_topic_name(self._topic)} "
                f"({', '.join(alive)}); {self._remedy}"
            )
        if time.monotonic() - self._started_s > START_UP_S:
            self._timer.cancel()
            self._speakers.close()

    def _speaks_longer(self, name: str) -> bool:
        """Whether another process speaks under a name that is up for longer; the younger one gives way."""
        for instance, voice in self._speakers.voices(name).items():
            older_s = self._node.up_since_s - voice.up_since_s
            is_first = older_s > 0.0 if abs(older_s) > TIE_S else instance < self._node.instance
            if instance != self._node.instance and is_first:
                return True
        return False


class LiveArm:
    """Hears whether an arm speaks on joint_states before one is played from bags.

    Parameters
    ----------
    node
        Who is about to play.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._joints: set[str] = set()
        self._subscription = AdaptiveSubscription(node, JointState, "joint_states", STATE, self._on_state)
        self._timer = steady_timer(node, LOOK_PERIOD_S, self._subscription.adapt)

    @property
    def listens(self) -> bool:
        """Whether it does, and so is one of the subscribers."""
        return not self._timer.is_canceled()

    def refuse(self) -> None:
        """Refuse to play beside an arm; call it before the first message is played, then `close`.

        Raises
        ------
        UserError
            Names the joints that are heard.
        """
        if len(self._joints) > 1:
            topic = self._node.resolve_topic_name("joint_states")
            raise UserError(
                f"an arm already speaks on {topic} ({', '.join(sorted(self._joints)[:8])}): who listens "
                f"would follow both; end its simulator or driver, or play on another domain or in a namespace"
            )

    def close(self) -> None:
        """Listen no more."""
        self._timer.cancel()
        self._subscription.close()

    def _on_state(self, received: Received) -> None:
        message = received.message
        self._joints.update(message.name if len(message.name) > 2 and message.position else ())
