"""What the simulated world tells: ticks, outcomes, and pictures for people."""

from __future__ import annotations

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.nodes.common import COMMAND, EVENT, LATCHED, STATE
from msrd_ros.nodes.frames import FramePublisher
from msrd_ros.nodes.messages import (
    ball_of_tick,
    feed_to_message,
    joints_of_tick,
    outcome_to_message,
    to_stamp,
)
from msrd_ros.nodes.scene_markers import scene_markers
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.simulation.world import Tick, World

SHOW_PERIOD_S = 1.0 / 30.0


class WorldOutput:
    """Publishes clock, joint states, ball, outcomes, frames and markers, and once the arm's description.

    Parameters
    ----------
    node
        Whose topics they are.
    world
        What is told of.
    robot
        Its arm.
    """

    def __init__(self, node: Node, world: World, robot: Robot) -> None:
        self._world, self._robot = world, robot
        self._shown_ns = 0
        self._path: list[NDArray[np.float64]] = []
        self._clock = node.create_publisher(ClockMessage, "clock", COMMAND)
        self._ball = node.create_publisher(PointStamped, "ball/position", STATE)
        self._joint_states = node.create_publisher(JointState, "joint_states", STATE)
        self._odometry = node.create_publisher(Odometry, "ball/odometry", STATE)
        self._outcome = node.create_publisher(DiagnosticArray, "rally/outcome", EVENT)
        self._scene = node.create_publisher(MarkerArray, "scene", COMMAND)
        self._description = node.create_publisher(String, "robot_description", LATCHED)
        self._description.publish(String(data=robot.urdf))
        self._frames = FramePublisher(node, robot)

    def publish_tick(self, show: bool) -> None:
        """Publish the present tick; `show` also makes pictures."""
        tick = self._world.tick()
        stamp = to_stamp(tick.time_ns)
        self._clock.publish(ClockMessage(clock=stamp))
        # The ball before the joints: whoever waits for both is then ready with the second.
        self._ball.publish(ball_of_tick(tick))
        if show and tick.time_ns - self._shown_ns >= SHOW_PERIOD_S * NANOSECONDS:
            self._show(tick, stamp)
        self._joint_states.publish(joints_of_tick(tick, self._robot))

    def publish_outcome(self, label: StrategyLabel | None, outcome: Outcome) -> None:
        """Tell what became of a ball, now."""
        self._outcome.publish(outcome_to_message(outcome, label, to_stamp(self._world.time_ns)))
        self._path = []

    def _show(self, tick: Tick, stamp: Any) -> None:
        """Pictures for people, at their own modest rate of simulated time."""
        self._shown_ns = tick.time_ns
        ball = self._world.rally.ball
        odometry = feed_to_message(Feed.from_state(ball), stamp)
        self._odometry.publish(odometry)
        self._frames.publish(tick.joint_position, stamp)
        if self._scene.get_subscription_count():
            self._path.append(ball[:3].copy())
            self._scene.publish(scene_markers(self._world.config.rally.scene, ball[:3], self._path))
