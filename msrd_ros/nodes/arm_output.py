"""What one arm of a match is told: the topics of an arm alone at the table, in the namespace of its end."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.nodes.common import EVENT, LATCHED, STATE
from msrd_ros.nodes.messages import ball_of_tick, joints_of_tick, outcome_to_message, to_stamp
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import End
from msrd_ros.table_tennis.simulation.world import Tick


class ArmOutput:
    """Publishes joint states, ball and outcomes in the frame of an end, and once the arm's description.

    Parameters
    ----------
    node
        Whose topics they are.
    robot
        The arm.
    end
        Where it stands.
    """

    def __init__(self, node: Node, robot: Robot, end: End) -> None:
        self._robot = robot
        self._ball = node.create_publisher(PointStamped, f"{end}/ball/position", STATE)
        self._joint_states = node.create_publisher(JointState, f"{end}/joint_states", STATE)
        self._outcome = node.create_publisher(DiagnosticArray, f"{end}/rally/outcome", EVENT)
        self._description = node.create_publisher(String, f"{end}/robot_description", LATCHED)
        self._description.publish(String(data=robot.urdf))

    def publish_tick(self, tick: Tick) -> None:
        """Publish the present tick: the ball, then the joints."""
        # Whoever waits for both is then ready with the second.
        self._ball.publish(ball_of_tick(tick))
        self._joint_states.publish(joints_of_tick(tick, self._robot))

    def publish_outcome(self, outcome: Outcome, label: StrategyLabel | None, time_ns: int) -> None:
        """Tell what became of a ball that this arm had."""
        self._outcome.publish(outcome_to_message(outcome, label, to_stamp(time_ns)))
