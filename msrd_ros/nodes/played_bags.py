"""Demonstrations that arrive on topics: bags being played, or a live recording session."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from msrd_ros.facts.episode import Episode
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.translation import EpisodeAssembler, read_outcome, stamp_to_ns
from msrd_ros.nodes.common import EVENT, STATE, steady_timer

SETTLE_S = 0.05
"""After an outcome, what was sent before it on other topics may still be on its way."""


class PlayedBags:
    """Cuts what it hears into strokes, one per rally/outcome.

    Parameters
    ----------
    node
        Whose subscriptions they are.
    take
        Called with every returned stroke.
    refuse
        Called with what is wrong with a stroke.
    """

    def __init__(
        self,
        node: Node,
        take: Callable[[Episode], None],
        refuse: Callable[[UserError], None],
    ) -> None:
        self._node, self._take, self._refuse = node, take, refuse
        self._balls: list[PointStamped] = []
        self._joints: list[JointState] = []
        self._decisions: deque[DiagnosticArray] = deque()
        self._subscriptions: list[Subscription] = [
            node.create_subscription(PointStamped, "ball/position", self._balls.append, STATE),
            node.create_subscription(JointState, "joint_states", self._joints.append, STATE),
            node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT),
        ]
        self._settle = steady_timer(node, SETTLE_S, self._assemble)
        self._settle.cancel()

    def close(self) -> None:
        """Listen no more."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._settle.cancel()

    def _on_outcome(self, message: DiagnosticArray) -> None:
        self._decisions.append(message)
        self._settle.reset()

    def _assemble(self) -> None:
        self._settle.cancel()
        while self._decisions:
            decision = self._decisions.popleft()
            joints, balls = _take_until(self._joints, decision), _take_until(self._balls, decision)
            try:
                label, outcome = read_outcome(decision)
                if not outcome.returned:
                    continue
                if label is None:
                    raise UserError(
                        "topic rally/outcome: no strategy label in the header; play labelled bags"
                    )
                assembler = EpisodeAssembler(label)
                for state in joints:
                    assembler.add_joint_state(state)
                for sample in balls:
                    assembler.add_ball_position(sample)
                assembler.add_outcome(decision)
                self._take(assembler.assemble())
            except UserError as error:
                self._refuse(error)


def _take_until(messages: list[Any], decision: DiagnosticArray) -> list[Any]:
    """Take out what belongs to the decided stroke; what follows is the next bag's already.

    The next bag begins where the stamps pass the decision, or jump back: bags of different sessions may
    tell of the same simulated times.
    """
    last_ns = stamp_to_ns(decision.header.stamp)
    before_ns, count = -1, 0
    for message in messages:
        stamp_ns = stamp_to_ns(message.header.stamp)
        if stamp_ns < before_ns or stamp_ns > last_ns:
            break
        before_ns, count = stamp_ns, count + 1
    taken = messages[:count]
    del messages[:count]
    return taken
