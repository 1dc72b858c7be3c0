"""Demonstrations that arrive on topics: bags being played, or a live recording session."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from msrd_ros.facts.episode import Episode
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.translation import EpisodeAssembler, read_outcome
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
        self._ball: list[PointStamped] = []
        self._joints: list[JointState] = []
        self._decision: DiagnosticArray | None = None
        self._subscriptions: list[Subscription] = [
            node.create_subscription(PointStamped, "ball/position", self._ball.append, STATE),
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
        self._decision = message
        self._settle.reset()

    def _assemble(self) -> None:
        self._settle.cancel()
        ball, joints = self._ball.copy(), self._joints.copy()
        self._ball.clear()
        self._joints.clear()
        decision, self._decision = self._decision, None
        if decision is None:
            return
        try:
            label, outcome = read_outcome(decision)
            if not outcome.returned:
                return
            if label is None:
                raise UserError("topic rally/outcome: no strategy label in the header; play labelled bags")
            assembler = EpisodeAssembler(label)
            for state in joints:
                assembler.add_joint_state(state)
            for sample in ball:
                assembler.add_ball_position(sample)
            assembler.add_outcome(decision)
            self._take(assembler.assemble())
        except UserError as error:
            self._refuse(error)
