"""Teachers lead the arm by the hand; what returned the ball is kept: `ros2 launch msrd_ros teach.launch.py`.

The recorder keeps its bags where its parameter file says; the demonstrator ends when its session is over.
"""

from launch import LaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Three nodes, each with its file in config/."""
    config = PathJoinSubstitution([FindPackageShare("msrd_ros"), "config"])
    return LaunchDescription(
        [
            Node(
                package="msrd_ros",
                executable="simulator",
                name="simulator",
                output="screen",
                parameters=[PathJoinSubstitution([config, "simulator.yaml"])],
            ),
            Node(
                package="msrd_ros",
                executable="recorder",
                name="recorder",
                output="screen",
                parameters=[PathJoinSubstitution([config, "recorder.yaml"])],
            ),
            Node(
                package="msrd_ros",
                executable="demonstrator",
                name="demonstrator",
                output="screen",
                parameters=[PathJoinSubstitution([config, "demonstrator.yaml"])],
            ),
        ]
    )
