"""Learn from the bags that the trainer's parameter file names: `ros2 launch msrd_ros train.launch.py`."""

from launch import LaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """One node with its file in config/."""
    config = PathJoinSubstitution([FindPackageShare("msrd_ros"), "config"])
    return LaunchDescription(
        [
            Node(
                package="msrd_ros",
                executable="trainer",
                name="trainer",
                output="screen",
                parameters=[PathJoinSubstitution([config, "trainer.yaml"])],
            ),
        ]
    )
