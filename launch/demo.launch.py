"""Teach, record, replay, train, play and report: `ros2 launch msrd_ros demo.launch.py`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up demo` starts; `--show-args` lists its arguments."""
    return describe("demo")
