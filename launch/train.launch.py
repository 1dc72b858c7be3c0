"""Learn from bags: `ros2 launch msrd_ros train.launch.py bags:=my_bags out:=runs/mine`."""

from launch import LaunchDescription

from msrd_ros.stack.launch_files import describe


def generate_launch_description() -> LaunchDescription:
    """What `python -m msrd_ros up train` starts; `--show-args` lists its arguments."""
    return describe("train")
