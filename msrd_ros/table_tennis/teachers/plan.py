"""``python -m msrd_ros plan ROBOT``: plan the six strokes for an arm, kept beside its description."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.teachers.planner import PLAN_FILE, kept_strokes, plan_all, write_strokes


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan all strokes, show them, and keep them."""
    parser = argparse.ArgumentParser(
        prog="msrd_ros plan", description="Plan the six strokes for an arm at the standard table."
    )
    parser.add_argument("robot", help="name of a shipped arm, or a folder with robot.yaml and robot.urdf")
    parser.add_argument("--dry-run", action="store_true", help="show them only")
    options = parser.parse_args(arguments)
    robot = load_robot(options.robot)
    strokes = plan_all(robot, kept=kept_strokes(robot))
    for label, stroke in strokes.items():
        speed, acceleration = stroke.peak_fractions(robot.limits)
        print(
            f"{label}: hit at {stroke.hit_time_s:.3f} s, at most {speed.max():.0%} of the speed limits and "
            f"{acceleration.max():.0%} of the acceleration limits"
        )
    if not options.dry_run:
        path = robot.folder / PLAN_FILE
        write_strokes(robot, strokes, path)
        print(f"written to {path}")
    return 0
