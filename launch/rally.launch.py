"""Two arms at one table play each other: `ros2 launch msrd_ros rally.launch.py`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up rally` starts; `--show-args` lists its arguments."""
    return describe("rally")
