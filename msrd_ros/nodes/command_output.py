"""Where commands leave: through the gate, and as a ros2_control trajectory controller takes them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from builtin_interfaces.msg import Time as Stamp
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.nodes.common import COMMAND
from msrd_ros.nodes.messages import points_to_message, to_stamp
from msrd_ros.robots.command_gate import CommandGate, command_points
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.robot import Robot


class CommandOutput:
    """Publishes joint_command.

    Parameters
    ----------
    node
        Whose topic it is.
    robot
        Whose joints, N of them.
    lockstep
        Whether commands answer ticks: their stamp is the tick's then. In real time it is zero, which a
        controller takes as "from now on".
    now_s
        Clock in seconds that never goes back.

    Attributes
    ----------
    sent
        Number of commands.
    sent_s
        When the last one was sent.
    """

    def __init__(self, node: Node, robot: Robot, lockstep: bool, now_s: Callable[[], float]) -> None:
        self._node, self._robot, self._lockstep, self._now_s = node, robot, lockstep, now_s
        self._gate = CommandGate(robot)
        self._publisher = node.create_publisher(JointTrajectory, "joint_command", COMMAND)
        self._message: JointTrajectory | None = None
        self.sent = 0
        self.sent_s = -np.inf

    def close(self) -> None:
        """Publish no more, so that somebody else may."""
        self._node.destroy_publisher(self._publisher)

    @property
    def last(self) -> JointReference | None:
        """The state sent last; None before the first, and after a pause."""
        return self._gate.last

    def rests_at(self, reference: JointReference) -> bool:
        """Whether the arm has been told to rest just there."""
        if self.last is None or np.any(self.last.velocity) or np.any(reference.velocity):
            return False
        return np.array_equal(self.last.position, reference.position)

    def send(self, reference: JointReference, label: StrategyLabel | None, time_ns: int) -> None:
        """Send a state to be reached in one control period, and how the arm then comes to rest.

        Raises
        ------
        UserError
            If it is beyond a limit, or too far from what was sent before; nothing is sent then.
        """
        points = command_points(self._robot, reference, CONTROL_PERIOD_S)
        self._gate.require(points)
        stamp = to_stamp(time_ns) if self._lockstep else Stamp()
        self._message = points_to_message(self._robot, points, label, stamp)
        self.sent += 1
        self.sent_s = self._now_s()
        self.repeat()

    def repeat(self) -> None:
        """Send the last command once more."""
        if self._message is not None:
            self._publisher.publish(self._message)

    def forget(self) -> None:
        """Begin anew from wherever the arm rests: nothing has been sent for a while."""
        self._gate.forget()
