"""The simulator and the executor: `ros2 launch msrd_ros stack.launch.py`.

Then ask for a stroke and serve a ball::

    ros2 topic pub --once --qos-durability transient_local strategy std_msgs/msg/Header \
        "{frame_id: forehand-topspin}"
    ros2 service call /simulator/serve std_srvs/srv/Trigger
"""

from launch import LaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Two nodes, each with its file in config/."""
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
                executable="executor",
                name="executor",
                output="screen",
                parameters=[PathJoinSubstitution([config, "executor.yaml"])],
            ),
        ]
    )
