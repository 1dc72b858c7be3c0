"""A page in the browser to watch and drive the stack with: `ros2 launch msrd_ros studio.launch.py`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up studio` starts; `--show-args` lists its arguments."""
    return describe("studio")
