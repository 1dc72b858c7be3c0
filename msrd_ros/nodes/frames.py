"""The robot's frames as TF, where the ROS installation brings the message type."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from msrd_ros.nodes.common import LATCHED, STATE
from msrd_ros.nodes.messages import WORLD
from msrd_ros.nodes.scene_markers import transform_stamped
from msrd_ros.table_tennis.kinematics import LINK_NAMES, link_frames
from msrd_ros.table_tennis.rotations import quaternion_from_rotation

try:
    # Part of every ROS installation, but of no wheel: without it there is no RViz to look at TF either.
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class FramePublisher:
    """Publishes each link's pose in `world`: `/tf` for the arm, `/tf_static` for its base."""

    def __init__(self, node: Node) -> None:
        self._moving = self._fixed = None
        if TFMessage is not None:
            self._moving = node.create_publisher(TFMessage, "/tf", STATE)
            self._fixed = node.create_publisher(TFMessage, "/tf_static", LATCHED)

    def publish(self, joint_position: NDArray[np.float64], stamp: Any) -> None:
        """Publish where the links are with these joint angles, shape (7,)."""
        if self._moving is None:
            return
        positions, rotations = link_frames(joint_position)
        self._moving.publish(
            TFMessage(
                transforms=[
                    transform_stamped(WORLD, name, position, quaternion_from_rotation(rotation), stamp)
                    for name, position, rotation in zip(LINK_NAMES, positions, rotations, strict=True)
                ]
            )
        )
