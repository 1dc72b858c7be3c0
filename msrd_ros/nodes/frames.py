"""The robot's frames as TF, where the ROS installation brings the message type."""

from __future__ import annotations

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time as TimeMessage
from numpy.typing import NDArray
from rclpy.node import Node

from msrd_ros.nodes.common import LATCHED, STATE
from msrd_ros.nodes.messages import WORLD
from msrd_ros.nodes.scene_markers import transform_stamped
from msrd_ros.robots.chain import rotation_from_roll_pitch_yaw
from msrd_ros.robots.kinematics import link_frames
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.robots.urdf import JointOrigin

try:
    # Part of every ROS installation, but of no wheel: without it there is no RViz to look at TF either.
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class FramePublisher:
    """Publishes each link's pose in `world`: `/tf` for the arm, `/tf_static` for its base."""

    def __init__(self, node: Node, robot: Robot) -> None:
        self._robot = robot
        self._moving = None
        if TFMessage is not None:
            self._moving = node.create_publisher(TFMessage, "/tf", STATE)
            fixed = node.create_publisher(TFMessage, "/tf_static", LATCHED)
            fixed.publish(
                TFMessage(transforms=[_fixed_frame(joint) for joint in robot.standing.fixed_joints])
            )

    def publish(self, joint_position: NDArray[np.float64], stamp: Any) -> None:
        """Publish where the links are with these joint angles, shape (N,)."""
        if self._moving is None:
            return
        positions, rotations = link_frames(self._robot.model, joint_position)
        self._moving.publish(
            TFMessage(
                transforms=[
                    transform_stamped(WORLD, name, position, quaternion_from_rotation(rotation), stamp)
                    for name, position, rotation in zip(
                        self._robot.link_names, positions, rotations, strict=True
                    )
                ]
            )
        )


def _fixed_frame(joint: JointOrigin) -> Any:
    rotation = rotation_from_roll_pitch_yaw(*joint.roll_pitch_yaw)
    return transform_stamped(
        joint.parent, joint.child, np.array(joint.offset), quaternion_from_rotation(rotation), TimeMessage()
    )
