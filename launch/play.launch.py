"""Play learned strategies in the simulator: `ros2 launch msrd_ros play.launch.py checkpoint:=FILE`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up play` starts; `--show-args` lists its arguments."""
    return describe("play")
