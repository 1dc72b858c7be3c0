"""Where the hand's gestures leave, point by point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msrd_ros.nodes.common import COMMAND
from msrd_ros.nodes.messages import gesture_to_message, released_hand, to_stamp
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture


class HandOutput:
    """Publishes teach/hand.

    Parameters
    ----------
    node
        Whose topic it is.
    robot
        Whose paddle is led; N joints.
    """

    def __init__(self, node: Node, robot: Robot) -> None:
        self._node, self._robot = node, robot
        self._publisher = node.create_publisher(MultiDOFJointTrajectory, "teach/hand", COMMAND)
        self._message: MultiDOFJointTrajectory | None = None
        self._holds = False

    def close(self) -> None:
        """Publish no more."""
        self._node.destroy_publisher(self._publisher)

    def send(self, gesture: HandGesture | None, joint_position: NDArray[np.float64], time_ns: int) -> None:
        """Say where the hand is, the joints being at (N,) rad; None: it does not hold the paddle."""
        stamp = to_stamp(time_ns)
        if gesture is None and self._holds:
            # A hand that only falls silent goes on for a while as it was.
            centre, rotation = paddle_pose(self._robot.model, joint_position)
            still = HandGesture.now(centre, quaternion_from_rotation(rotation))
            self._message = gesture_to_message(still, stamp)
        elif gesture is None:
            self._message = released_hand(stamp)
        else:
            self._message = gesture_to_message(gesture, stamp)
        self._holds = gesture is not None
        self.repeat()

    def repeat(self) -> None:
        """Send the last point once more."""
        if self._message is not None:
            self._publisher.publish(self._message)

    def forget(self) -> None:
        """Have nothing to repeat."""
        self._message = None
