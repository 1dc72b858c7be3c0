"""Targets for strokes that are measured: drawn from what is in reach, told, and heard of before the ball."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from numpy.typing import NDArray
from rclpy.node import Node

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.adaptive import hear
from msrd_ros.nodes.common import EVENT, LATCHED
from msrd_ros.nodes.messages import target_to_message
from msrd_ros.table_tennis.strokes.policies import StrokeFacts
from msrd_ros.table_tennis.strokes.reach import Reach, say_point

TARGET_STREAM = 0x7A26E7


class TargetTeller:
    """Tells the executor of the node's namespace where each ball is to land.

    Parameters
    ----------
    node
        Whose topics they are.
    labels
        Strategies that are played.
    facts
        Of those that there are policies for.
    seed
        Of the targets.

    Raises
    ------
    UserError
        If a strategy takes no target.

    Attributes
    ----------
    is_heard
        Whether the executor aims at what it was told last.
    targets
        All that was told, of each strategy that has any in reach, (2,) each, m.
    """

    def __init__(
        self,
        node: Node,
        labels: Sequence[StrategyLabel],
        facts: Mapping[StrategyLabel, StrokeFacts],
        seed: int,
    ) -> None:
        self._node, self._rng = node, np.random.default_rng((TARGET_STREAM, seed))
        self._reaches: dict[StrategyLabel, Reach] = {}
        if not facts:
            raise UserError("parameter targets: give the checkpoint, which says what is in reach")
        for label in labels:
            known = facts[label]
            if known.reach is None:
                raise UserError(
                    f"parameter targets: {label} takes no target; learn targets for it: "
                    "`python -m msrd_ros aim`, or leave targets out"
                )
            if known.reach.hits.any():
                self._reaches[label] = known.reach
            else:
                node.get_logger().warning(f"{label} has no target in reach; it is told none")
        self.targets: dict[StrategyLabel, list[NDArray[np.float64]]] = {one: [] for one in self._reaches}
        self._told: NDArray[np.float64] | None = None
        self.is_heard = True
        self._target = node.create_publisher(PointStamped, "target", LATCHED)
        hear(node, DiagnosticArray, "/diagnostics", self._on_diagnostics, EVENT)

    def tell(self, label: StrategyLabel) -> None:
        """Draw a target in reach of a strategy, and tell it; where none is, tell none."""
        if label not in self._reaches:
            self.take_back()
            return
        self._told = self._reaches[label].draw(self._rng)
        self.targets[label].append(self._told)
        self.is_heard = False
        self._publish()

    def take_back(self) -> None:
        """Leave no target behind."""
        self._told, self.is_heard = None, True
        self._publish()

    def _publish(self) -> None:
        self._target.publish(target_to_message(self._told, self._node.get_clock().now().to_msg()))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if self._told is None:
            return
        for item in message.status:
            aimed_at = {pair.key: pair.value for pair in item.values}.get("target")
            namespace = item.name.rpartition("/")[0] or "/"
            if namespace == self._node.get_namespace() and aimed_at == say_point(self._told):
                self.is_heard = True
