"""Rollouts over topics: every stroke goes through executor and simulator in lockstep."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, UInt8MultiArray
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import EpisodeAssembler, read_outcome, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.nodes.adaptive import hear
from msrd_ros.nodes.common import COMMAND, EVENT, LATCHED, STATE, referee_hears
from msrd_ros.nodes.messages import (
    bytes_to_message,
    feed_to_message,
    strategy_message,
)
from msrd_ros.table_tennis.strokes.rollouts import PolicySource, StrokeBatch

PATIENCE_S = 5.0
"""A stroke with all its ways takes less."""


class TopicCollector:
    """A collector that publishes policies, strategies and feeds, and listens to what comes of them.

    `collect` blocks a worker thread while the node's callbacks run on the main thread.

    Parameters
    ----------
    node
        Whose topics they are.
    source
        Gives the present policies.
    spread, ready_noise_rad
        Of the feeds and of the start posture.
    timeout_s
        Longest wait for one stroke.
    """

    def __init__(
        self, node: Node, source: PolicySource, spread: str, ready_noise_rad: float, timeout_s: float
    ) -> None:
        self._node, self._source = node, source
        self._spread, self._ready_noise_rad, self._timeout_s = spread, ready_noise_rad, timeout_s
        self._balls = 0
        self._awaited, self._since_s = "", 0.0
        self._wanted: StrategyLabel | None = None
        self._digest = ""
        self._connected = False
        self._swapped = threading.Event()
        self._taken_up = threading.Event()
        self._decided = threading.Event()
        self._assembler: EpisodeAssembler | None = None
        self._outcome: Outcome | None = None
        self._over_ns = self._joints_ns = self._ball_ns = 0
        self._policy = node.create_publisher(UInt8MultiArray, "policy", LATCHED)
        self._strategy = node.create_publisher(Header, "strategy", LATCHED)
        self._feed = node.create_publisher(Odometry, "feed", EVENT)
        hear(node, PointStamped, "ball/position", self._or_complain(self._on_ball), STATE)
        hear(node, JointState, "joint_states", self._or_complain(self._on_joint_state), STATE)
        hear(node, JointTrajectory, "joint_command", self._on_command, COMMAND)
        hear(node, DiagnosticArray, "rally/outcome", self._or_complain(self._on_outcome), EVENT)
        hear(node, DiagnosticArray, "/diagnostics", self._on_diagnostics, EVENT)

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        """Play `episodes` strokes of every strategy.

        Raises
        ------
        UserError
            If executor or simulator do not answer in time.
        """
        batch = StrokeBatch.draw(
            self._source(), episodes, self._spread, self._ready_noise_rad, self._balls, rng
        )
        self._balls += len(batch.strokes)
        return batch.rollouts([episode for episode, _ in self.play(batch)], policies)

    def play(self, batch: StrokeBatch) -> list[tuple[Episode, Outcome]]:
        """Play a batch; episodes and outcomes in its order."""
        self._digest = batch.policies.digest
        self._swapped.clear()
        self._policy.publish(bytes_to_message(batch.policies.to_bytes()))
        self._wait(self._swapped, "the executor does not take up the policies")
        played: list[tuple[Episode, Outcome]] = []
        for stroke in batch.strokes:
            self._wanted = stroke.label
            self._taken_up.clear()
            self._strategy.publish(strategy_message(stroke.label, self._node.get_clock().now().to_msg()))
            self._wait(self._taken_up, f"the executor does not take up strategy {stroke.label}")
            self._decided.clear()
            self._outcome = None
            self._assembler = EpisodeAssembler(stroke.label, robot=batch.policies.robot)
            self._feed.publish(feed_to_message(stroke.feed))
            self._wait(self._decided, f"no rally/outcome for ball {stroke.number} ({stroke.label})")
            assembler, self._assembler = self._assembler, None
            assert self._outcome is not None
            played.append((assembler.assemble(), self._outcome))
        return played

    @property
    def awaited(self) -> str:
        """What is waited for, for longer than an answer takes; empty if nothing is."""
        late = self._awaited and time.monotonic() - self._since_s > PATIENCE_S
        return f"rollouts: {self._awaited}; start simulator and executor" if late else ""

    def _wait(self, event: threading.Event, complaint: str) -> None:
        self._awaited, self._since_s = complaint, time.monotonic()
        answered = event.wait(self._timeout_s)
        self._awaited = ""
        if not answered:
            raise UserError(
                f"{complaint} in {self._timeout_s:g} s; start simulator and executor (accept_policy:=true)"
            )

    def _or_complain(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """A message that cannot be used is named and passed over; training goes on."""

        def take(message: Any) -> None:
            try:
                callback(message)
            except UserError as error:
                self._node.get_logger().error(str(error))

        return take

    def _on_command(self, message: JointTrajectory) -> None:
        if message.header.frame_id == str(self._wanted):
            self._connected = self._connected or referee_hears(self._node, self._feed)
            if self._connected:
                self._taken_up.set()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            namespace = item.name.rpartition("/")[0] or "/"
            if namespace != self._node.get_namespace() or not self._digest:
                continue
            if values.get("policies") == self._digest:
                self._swapped.set()

    def _on_ball(self, message: PointStamped) -> None:
        if self._assembler is not None:
            self._assembler.add_ball_position(message)
            self._ball_ns = stamp_to_ns(message.header.stamp)
            self._decide_if_all_was_heard()

    def _on_joint_state(self, message: JointState) -> None:
        if self._assembler is not None:
            self._assembler.add_joint_state(message)
            self._joints_ns = stamp_to_ns(message.header.stamp)
            self._decide_if_all_was_heard()

    def _on_outcome(self, message: DiagnosticArray) -> None:
        if self._assembler is not None:
            _, self._outcome = read_outcome(message)
            self._over_ns = stamp_to_ns(message.header.stamp)
            self._decide_if_all_was_heard()

    def _decide_if_all_was_heard(self) -> None:
        """An outcome overtakes states that still wait in their queues: the stroke is whole with its tick."""
        if self._outcome is not None and min(self._joints_ns, self._ball_ns) >= self._over_ns:
            self._decided.set()
