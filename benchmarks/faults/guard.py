"""Watches from outside what an executor sends to an arm, and what a recorder says that it has kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from trajectory_msgs.msg import JointTrajectory

from faults.trials import Finding
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.nodes.recorder import VERDICT
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.robot import Robot

DEPTH = 10_000
SLACK = 1.0 + 1e-6


class Guard:
    """Holds every `joint_command` against the robot's limits, and every step between two of them.

    Parameters
    ----------
    node
        Whose subscriptions they are.
    robot
        The arm.
    finding
        Hears of broken promises.
    """

    def __init__(self, node: Node, robot: Robot, finding: Finding) -> None:
        self._robot, self._finding = robot, finding
        self._last: tuple[int, np.ndarray[Any, Any]] | None = None
        self.commands = 0
        self.outcomes = 0
        self.outcome_s = 0.0
        """The stack's own time of the last outcome."""
        self.last_s = 0.0
        self.speed = 0.0
        self.kept: list[Path] = []
        profile = QoSProfile(depth=DEPTH)
        self._node = node
        self._commands = node.create_subscription(JointTrajectory, "joint_command", self._on_command, profile)
        self._subscriptions = [
            node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, profile),
            node.create_subscription(DiagnosticArray, VERDICT, self._on_verdict, profile),
        ]

    def leave_commands(self) -> None:
        """Look at no more commands: in a run whose speed counts."""
        self._node.destroy_subscription(self._commands)

    def forget(self) -> None:
        """Begin anew: the next command is the first of another executor."""
        self._last = None

    def _on_outcome(self, message: DiagnosticArray) -> None:
        self.outcomes += 1
        self.outcome_s = stamp_to_ns(message.header.stamp) / 1e9

    def _on_verdict(self, message: DiagnosticArray) -> None:
        values = {item.key: item.value for status in message.status for item in status.values}
        if values.get("path"):
            self.kept.append(Path(values["path"]))

    def _on_command(self, message: JointTrajectory) -> None:
        self.commands += 1
        self.last_s = time.monotonic()
        limits = self._robot.limits
        where = f"command {self.commands}"
        stamp_ns = stamp_to_ns(message.header.stamp)
        for number, point in enumerate(message.points):
            position, velocity = np.array(point.positions), np.array(point.velocities)
            count = self._robot.joint_count
            if position.shape != (count,) or velocity.shape != (count,):
                self._finding.break_promise(f"{where}: {position.size} positions, {velocity.size} velocities")
                return
            # Written so that NaN fails, too.
            inside = (position >= limits.lower_rad) & (position <= limits.upper_rad)
            inside &= np.abs(velocity) <= limits.speed_rad_s * SLACK
            if not inside.all():
                joint = int(np.flatnonzero(~inside)[0])
                self._finding.break_promise(
                    f"{where}: {self._robot.joint_names[joint]} to {position[joint]:.4g} rad "
                    f"at {velocity[joint]:.4g} rad/s"
                )
            if number == 0:  # the others are how the arm would come to rest if nothing followed
                self.speed = float(np.abs(velocity).max())
                self._check_step(where, stamp_ns, position)

    def _check_step(self, where: str, stamp_ns: int, position: np.ndarray[Any, Any]) -> None:
        last, self._last = self._last, (stamp_ns, position)
        if last is None:
            return
        # A command that is sent again, or that overtakes one, is a step of no time.
        period_s = max((stamp_ns - last[0]) / 1e9, 0.02)
        step = np.abs(position - last[1])
        if (step > self._robot.limits.speed_rad_s * period_s * 1.1).any():
            joint = int((step / self._robot.limits.speed_rad_s).argmax())
            self._finding.break_promise(
                f"{where}: {self._robot.joint_names[joint]} leaps {step[joint]:.3f} rad in {period_s:.3f} s"
            )


def check_kept(guard: Guard, folder: Path, finding: Finding) -> None:
    """Every stroke that the recorder said it had kept is there, and can be read."""
    lost = [path for path in guard.kept if not path.is_dir()]
    for path in lost:
        finding.break_promise(f"{path.name} was said to be kept and is not there")
    if guard.kept and not lost:
        library = BagLibrary.scan(folder)
        for line in library.refused:
            finding.break_promise(f"a bag that cannot be read: {line}")
    finding.figures["strokes kept"] = len(guard.kept)


def wait_until(spin: Callable[[], None], condition: Callable[[], bool], seconds: float) -> bool:
    """Spin until a condition holds; False if it does not in time."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        spin()
    return True
