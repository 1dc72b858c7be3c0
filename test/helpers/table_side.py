"""The robot's side of the table, made up for tests: hears whole ticks, answers them, feeds balls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time as TimeMessage
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import read_outcome, stamp_to_ns
from msrd_ros.nodes.common import COMMAND, EVENT, LATCHED, STATE
from msrd_ros.nodes.messages import command_to_message, feed_to_message
from msrd_ros.robots.limits import JointReference
from msrd_ros.table_tennis.ball.feeder import Feed
from sawyer import ROBOT
from stack import Stack


class SeenTick(NamedTuple):
    """One tick as it came over the topics: joints (3, 7) are positions, velocities and efforts."""

    time_ns: int
    label: str
    joints: NDArray[np.float64]
    ball: NDArray[np.float64]


class TableSide:
    """Publishers and subscriptions of everybody who is not the simulator.

    Parameters
    ----------
    node
        Whose they are.
    answers
        Whether it answers ticks itself; an executor tolerates nobody beside it.
    """

    def __init__(self, node: Node, answers: bool = True) -> None:
        self.node = node
        self.states: list[JointState] = []
        self.balls: list[PointStamped] = []
        self.outcomes: list[tuple[StrategyLabel | None, Outcome]] = []
        if answers:
            self.command = node.create_publisher(JointTrajectory, "joint_command", COMMAND)
        self.strategy = node.create_publisher(Header, "strategy", LATCHED)
        self.feed = node.create_publisher(Odometry, "feed", EVENT)
        node.create_subscription(PointStamped, "ball/position", self.balls.append, STATE)
        node.create_subscription(JointState, "joint_states", self.states.append, STATE)
        node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT)

    def answer(
        self,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64] | None = None,
        label: StrategyLabel | None = None,
        stamp: TimeMessage | None = None,
    ) -> JointTrajectory:
        """Send a command, by default with the stamp of the newest joint state."""
        reference = JointReference(position, np.zeros(7) if velocity is None else velocity)
        message = command_to_message(
            ROBOT, reference, label, stamp or self.states[-1].header.stamp, CONTROL_PERIOD_S
        )
        self.command.publish(message)
        return message

    def ask(self, label: StrategyLabel | str) -> None:
        """Say which strategy is wanted."""
        self.strategy.publish(Header(frame_id=str(label)))

    def throw(self, feed: Feed, not_before_ns: int = 0) -> None:
        """Feed a ball."""
        self.feed.publish(feed_to_message(feed, Time(nanoseconds=not_before_ns).to_msg()))

    @property
    def tick_ns(self) -> int:
        """Stamp of the newest joint state; -1 before the first."""
        return stamp_to_ns(self.states[-1].header.stamp) if self.states else -1

    def stand(self, stack: Stack, label: StrategyLabel | None, until: Callable[[], Any], what: str) -> None:
        """Answer every tick with where the arm is, on behalf of a strategy, until a condition holds."""
        answered_ns, position = -1, None

        def answer_and_look() -> Any:
            nonlocal answered_ns, position
            if self.states and self.tick_ns != answered_ns:
                answered_ns = self.tick_ns
                position = np.array(self.states[-1].position) if position is None else position
                self.answer(position, label=label)
            return until()

        stack.wait_until(answer_and_look, what)

    def rally_ticks(self) -> list[SeenTick]:
        """The labelled ticks since `clear`, each once; those that showed a new frame of the ball."""
        points = {stamp_to_ns(ball.header.stamp): ball.point for ball in self.balls}
        ticks: dict[int, SeenTick] = {}
        for state in self.states:
            time_ns = stamp_to_ns(state.header.stamp)
            if state.header.frame_id and time_ns in points:
                point = points[time_ns]
                joints = np.array([state.position, state.velocity, state.effort])
                ball = np.array([point.x, point.y, point.z])
                ticks[time_ns] = SeenTick(time_ns, state.header.frame_id, joints, ball)
        return list(ticks.values())

    @property
    def rally_over(self) -> bool:
        """Whether there is an outcome, and its tick has been heard, too: states may come later."""
        over = bool(self.outcomes and self.states and self.balls) and not self.states[-1].header.frame_id
        return over and stamp_to_ns(self.balls[-1].header.stamp) >= self.tick_ns

    def clear(self) -> None:
        """Forget what was heard."""
        for heard in (self.states, self.balls, self.outcomes):
            heard.clear()

    def _on_outcome(self, message: DiagnosticArray) -> None:
        self.outcomes.append(read_outcome(message))
