"""Ticks of the control loop: a joint state and the ball sample that belongs to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PointStamped
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from msrd_ros.contract.translation import JointStateTranslator, read_ball_position, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import STATE
from msrd_ros.robots.robot import Robot


class TickInput(NamedTuple):
    """What came in at one tick: joints (N,) in rad and rad/s, the newest ball sample (3,) in m."""

    time_ns: int
    joint_position: NDArray[np.float64]
    joint_velocity: NDArray[np.float64]
    ball_position: NDArray[np.float64]
    ball_stamp_ns: int


class TickInputs:
    """Subscribes to joint_states and ball/position and hands on whole ticks.

    In lockstep every tick brings one message of each, and the world stands still until it is answered; a
    tick that comes again is answered again. In real time each joint state makes a tick with the newest ball.

    Parameters
    ----------
    node
        Whose subscriptions they are.
    robot
        Whose joints, N of them.
    lockstep
        Whether to wait for both.
    act
        Called with each new tick.
    repeat
        Called when the simulator asks again for the last one.
    refuse
        Called with what is wrong with a message; the last good ball sample then stays.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        lockstep: bool,
        act: Callable[[TickInput], None],
        repeat: Callable[[], None],
        refuse: Callable[[UserError], None],
    ) -> None:
        self._lockstep = lockstep
        self._act, self._repeat, self._refuse = act, repeat, refuse
        self._joints = JointStateTranslator(robot)
        self._pending: JointState | None = None
        self._ball: tuple[NDArray[np.float64], int] | None = None
        self._has_new_ball = False
        self._answered_ns = -1
        self._last: TickInput | None = None
        # The ball first: within a tick it is sent first, and is then taken first.
        node.create_subscription(PointStamped, "ball/position", self._on_ball, STATE)
        node.create_subscription(JointState, "joint_states", self._on_joint_state, STATE)

    def act_again(self) -> None:
        """Act on the last tick once more, if there was one."""
        if self._last is not None:
            self._act(self._last)

    def _on_ball(self, message: PointStamped) -> None:
        try:
            self._ball = read_ball_position(message), stamp_to_ns(message.header.stamp)
        except UserError as error:
            self._refuse(error)
        self._has_new_ball = True
        self._act_if_complete()

    def _on_joint_state(self, message: JointState) -> None:
        if stamp_to_ns(message.header.stamp) == self._answered_ns:
            # Asked again: the ball sample that came with it was the old one as well.
            self._has_new_ball = False
            self._repeat()
            return
        self._pending = message
        self._act_if_complete()

    def _act_if_complete(self) -> None:
        if self._pending is None or self._ball is None or (self._lockstep and not self._has_new_ball):
            return
        message, self._pending, self._has_new_ball = self._pending, None, False
        try:
            position, velocity = self._joints.read(message)
        except UserError as error:
            self._refuse(error)
            return
        self._answered_ns = stamp_to_ns(message.header.stamp)
        self._last = TickInput(self._answered_ns, position, velocity, *self._ball)
        self._act(self._last)
