"""Teach by hand and record: `ros2 launch msrd_ros teach.launch.py bags:=my_bags`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up teach` starts; `--show-args` lists its arguments."""
    return describe("teach")
