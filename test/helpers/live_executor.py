"""The executor inside the test's own process: messages are put in, commands come out, time is the test's."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.time import Time
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.nodes.adaptive import Received
from msrd_ros.nodes.executor import Executor
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.stack.processes import ros_arguments
from sawyer import (
    ACCELERATION_LIMIT_RAD_S2,
    HOME_POSTURE_RAD,
    JOINT_COUNT,
    JOINT_NAMES,
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    SPEED_LIMIT_RAD_S,
)

RESTING = np.array([1.5, 0.0, 1.06])
ROUNDING = 1e-6


class LiveExecutor:
    """An executor with an arm that follows to the letter.

    Parameters
    ----------
    node
        The executor.
    """

    def __init__(self, node: Executor) -> None:
        self.node = node
        self.now_s = 100.0
        self.stamp_ns = 10**9
        self.position = HOME_POSTURE_RAD.copy()
        self.commands: list[JointTrajectory] = []
        self.said: list[str] = []
        self._sequence = 0
        node._now_s = lambda: self.now_s
        node._output._publisher.publish = self.commands.append  # type: ignore[assignment, method-assign]
        node.complain = lambda error: self.said.append(str(error))  # type: ignore[method-assign]

    @property
    def moves(self) -> bool:
        """Whether the arm has been told to be anywhere but at rest."""
        return bool(self.commands) and bool(np.any(self.commands[-1].points[0].velocities))

    def strategy(self, label: object) -> None:
        """Ask for a strategy."""
        self.node._on_strategy(Header(frame_id=str(label)))

    def policies(self, data: bytes) -> None:
        """Send policies."""
        self.node._on_policy(bytes_to_message(data))

    def wait(self, seconds: float) -> None:
        """Let time pass; in real time the watchdog runs."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += CONTROL_PERIOD_S
            self.node._watch() if not self.node._lockstep else None

    def ball(self, position: Any = RESTING, stamp_ns: int | None = None) -> None:
        """One sample of the camera."""
        message = PointStamped()
        message.header.stamp = Time(nanoseconds=self.stamp_ns if stamp_ns is None else stamp_ns).to_msg()
        message.point.x, message.point.y, message.point.z = map(float, position)
        self.node._inputs._on_ball(Received(message, 0, 0, 0, 0))

    def joints(self, state: JointState | None = None, sequence: int | None = None) -> None:
        """One joint state; the arm's own unless another is given."""
        if state is None:
            state = joint_state(self.position)
            state.header.stamp = Time(nanoseconds=self.stamp_ns).to_msg()
        self._sequence += 1
        self.node._inputs._on_joint_state(Received(state, 0, 0, sequence or self._sequence, 0))

    def tick(self, ball: Any = RESTING, state: JointState | None = None) -> None:
        """Let one control period pass, show ball and joints, and let the arm follow."""
        self.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        self.wait(CONTROL_PERIOD_S)
        self.ball(ball)
        self.joints(state)
        self.follow()

    def follow(self) -> None:
        """Let the arm be where it was sent."""
        if self.commands:
            self.position = np.array(self.commands[-1].points[0].positions)

    def make_ready(self, label: object) -> None:
        """Tick until the arm rests in the ready pose of a strategy."""
        self.strategy(label)
        for _ in range(500):
            self.tick()
            player = self.node._player
            if player is not None and player.phase.value == "ready" and self.node._exchange.strategy == label:
                return
        raise AssertionError("never ready")

    def swing(self, steps: int = 20) -> None:
        """Play the beginning of a stroke."""
        for step in range(steps):
            self.tick(flying(step))
        assert self.moves


def joint_state(position: Any, names: Any = JOINT_NAMES) -> JointState:
    """A joint state at rest."""
    values = [float(value) for value in position]
    return JointState(name=list(names), position=values, velocity=[0.0] * len(values))


def flying(step: int) -> np.ndarray:
    """The ball, `step` ticks after its launch."""
    position: np.ndarray = RESTING + np.array([-0.1 * step, 0.002 * step, 0.01 * step])
    return position


def require_safe(commands: list[JointTrajectory], pauses: bool = False) -> None:
    """Every command is whole, within limits, ends at rest, and follows from the one before it.

    Parameters
    ----------
    commands
        In the order in which they were sent.
    pauses
        Whether commands after a pause may begin anew from rest.
    """
    before: Any = None
    for command in commands:
        assert command.joint_names == list(JOINT_NAMES)
        times = [point.time_from_start.sec + point.time_from_start.nanosec / 1e9 for point in command.points]
        assert times[0] == CONTROL_PERIOD_S
        assert np.all(np.diff(times) > 0.0)
        assert not np.any(command.points[-1].velocities)
        earlier, earlier_s = before, 0.0
        for point, time_s in zip(command.points, times, strict=True):
            position, velocity = np.array(point.positions), np.array(point.velocities)
            assert position.shape == velocity.shape == (JOINT_COUNT,)
            assert np.all((position >= POSITION_LOWER_RAD) & (position <= POSITION_UPPER_RAD))
            assert np.all(np.abs(velocity) <= SPEED_LIMIT_RAD_S + ROUNDING)
            anew = pauses and earlier_s == 0.0 and earlier is not None and not np.any(earlier[1])
            if earlier is not None and not anew:
                passed_s = time_s - earlier_s
                assert np.all(np.abs(position - earlier[0]) <= SPEED_LIMIT_RAD_S * passed_s + ROUNDING)
                change = np.abs(velocity - earlier[1])
                assert np.all(change <= ACCELERATION_LIMIT_RAD_S2 * passed_s + ROUNDING)
            earlier, earlier_s = (position, velocity), time_s
        before = np.array(command.points[0].positions), np.array(command.points[0].velocities)


@contextmanager
def live_executor(domain_id: int, **parameters: object) -> Iterator[LiveExecutor]:
    """An executor on a domain of its own, alone there; configured, and active unless `autostart` is false."""
    rclpy.init(args=ros_arguments(parameters), domain_id=domain_id)
    node = Executor()
    if not node.config.autostart:
        node.trigger_configure()
    try:
        yield LiveExecutor(node)
    finally:
        node.destroy_node()
        try_shutdown()
