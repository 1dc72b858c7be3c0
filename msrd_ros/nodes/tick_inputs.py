"""Ticks of the control loop: a joint state and the ball sample that belongs to it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PointStamped
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from msrd_ros.contract.translation import JointStateTranslator, read_ball_position, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.adaptive import ADAPT_PERIOD_S, AdaptiveSubscription, Received
from msrd_ros.nodes.common import LOCKSTEP, STATE, steady_timer
from msrd_ros.nodes.input_clocks import InputClocks, Order
from msrd_ros.nodes.polled import Unhurried
from msrd_ros.nodes.sources import Sources
from msrd_ros.robots.command_gate import require_possible
from msrd_ros.robots.robot import Robot

SILENCE_S = 2.0
"""Not heard for so long, a topic is waited for."""
FURTHEST_BALL_M = 50.0


class TickInput(NamedTuple):
    """What came in at one tick: joints (N,) in rad and rad/s, the newest ball sample (3,) in m.

    Attributes
    ----------
    ball_is_present
        Whether the sample is of now: neither stale nor of a clock that is not the joints'.
    time_went_back
        Whether this is the first tick of another time: a world that was started again, a clock that was set.
    """

    time_ns: int
    joint_position: NDArray[np.float64]
    joint_velocity: NDArray[np.float64]
    ball_position: NDArray[np.float64]
    ball_stamp_ns: int
    ball_is_present: bool = True
    time_went_back: bool = False


class _Ball(NamedTuple):
    """A sample: where the ball is, (3,) in m, of when that is, and when it came in."""

    position: NDArray[np.float64]
    stamp_ns: int
    came_s: float


class TickInputs:
    """Subscribes to joint_states and ball/position and hands on whole ticks.

    In lockstep every tick brings one message of each, and the world stands still until it is answered; a
    tick that comes again is answered again. In real time each joint state makes a tick with the newest ball.
    A joint state that cannot be, or comes from one of several sources, makes no tick.

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
    timeout_s
        Gives the age in s beyond which a ball sample is not of now.
    distrust
        Called when a joint state cannot be relied on: the arm then comes to rest at once.
    now_s
        Clock in seconds that never goes back.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        lockstep: bool,
        act: Callable[[TickInput], None],
        repeat: Callable[[], None],
        refuse: Callable[[UserError], None],
        timeout_s: Callable[[], float] = lambda: math.inf,
        distrust: Callable[[], None] = lambda: None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._node, self._robot = node, robot
        self._lockstep = lockstep
        self._act, self._repeat, self._refuse, self._distrust = act, repeat, refuse, distrust
        self._timeout_s, self._now_s = timeout_s, now_s
        self._joints = JointStateTranslator(robot)
        self._clocks = InputClocks(not lockstep, timeout_s)
        self._sources = Sources()
        self._pending: tuple[JointState, Order] | None = None
        self._ball: _Ball | None = None
        self._good_ball: _Ball | None = None
        self._has_new_ball = False
        self._answered_ns = -1
        self._told = ""
        self._joints_heard_s = self._ball_heard_s = -math.inf
        self._last: TickInput | None = None
        # The ball first: within a tick it is sent first, and is then taken first.
        quality = LOCKSTEP if lockstep else STATE
        # In lockstep it wakes nobody but where joints wait for it: there is nothing to do about it alone.
        group = Unhurried(lambda: not lockstep or self._pending is not None)
        self._ball_samples = AdaptiveSubscription(
            node, PointStamped, "ball/position", quality, self._on_ball, group=group
        )
        self._subscriptions = [
            self._ball_samples,
            AdaptiveSubscription(node, JointState, "joint_states", quality, self._on_joint_state),
        ]
        self._timer = steady_timer(node, ADAPT_PERIOD_S, self._look_around)

    def close(self) -> None:
        """Hear no more ticks."""
        self._node.destroy_timer(self._timer)
        for subscription in self._subscriptions:
            subscription.close()

    @property
    def missing(self) -> list[str]:
        """What is not heard, or no more, or not to be relied on, each with what to do about it."""
        found = []
        long_ago_s = self._now_s() - SILENCE_S
        if self._joints_heard_s < long_ago_s:
            found.append("joint_states: start a simulator or the robot's driver")
        if self._ball_heard_s < long_ago_s:
            found.append("ball/position: start a simulator or the camera")
        if self._clocks.fault:
            found.append(f"clocks that agree: {self._clocks.fault}")
        if self.sources > 1:
            found.append(f"one arm instead of {self.sources}: let one source publish joint_states")
        return found

    @property
    def sources(self) -> int:
        """How many publishers tell of this arm's joints at the moment."""
        return self._sources.count(self._now_s())

    def act_again(self) -> None:
        """Act on the last tick once more, if there was one."""
        if self._last is not None:
            self._act(self._last)

    def _look_around(self) -> None:
        for subscription in self._subscriptions:
            subscription.adapt()
        for line in self._joints.news():
            self._node.get_logger().warning(line)

    def _on_ball(self, received: Received) -> None:
        now_s = self._ball_heard_s = self._now_s()
        message = received.message
        try:
            position = read_ball_position(message)
            if np.abs(position).max() > FURTHEST_BALL_M:
                raise UserError(
                    f"topic ball/position: {position} is out of any room; give it in metres in frame world"
                )
            self._ball = _Ball(position, stamp_to_ns(message.header.stamp), now_s)
            self._clocks.ball(self._ball.stamp_ns, now_s)
        except UserError as error:
            self._refuse(error)
        self._has_new_ball = True
        self._act_if_complete()

    def _on_joint_state(self, received: Received) -> None:
        message = received.message
        if not self._joints.belongs(message.name):
            return  # another device's
        if self._lockstep:
            self._ball_samples.take_waiting()
        now_s = self._joints_heard_s = self._now_s()
        self._sources.add(received.sequence, now_s)
        if self._sources.count(now_s) > 1:
            self._refuse_several()
            return
        stamp_ns = stamp_to_ns(message.header.stamp)
        if self._lockstep and stamp_ns == self._answered_ns:
            # Asked again: the ball sample that came with it was the old one as well.
            self._has_new_ball = False
            self._repeat()
            return
        order = self._clocks.joints(stamp_ns, now_s)
        self._tell_faults()
        if order is Order.SET:
            self._ball = self._ball if self._lockstep else None
            self._good_ball = None
            self._refuse(UserError(f"topic joint_states: time is {stamp_ns / 1e9:.3f} s now; starts afresh"))
        # In lockstep a tick that could not be answered comes again.
        if order in (Order.NEW, Order.SET) or self._lockstep:
            self._pending = message, order
            self._act_if_complete()

    def _act_if_complete(self) -> None:
        if self._pending is None or self._ball is None or (self._lockstep and not self._has_new_ball):
            return
        (message, order), self._pending, self._has_new_ball = self._pending, None, False
        try:
            sample = self._joints.sample(message)
            if sample is None:
                return
            require_possible(self._robot, sample.position, "topic joint_states")
        except UserError as error:
            self._refuse(error)
            self._distrust()
            return
        now_s = self._now_s()
        if self._clocks.ball_agrees():
            self._good_ball = self._ball
        self._tell_faults()
        ball = self._good_ball or self._ball
        present = self._good_ball is not None and (
            self._clocks.age_s(ball.stamp_ns, ball.came_s, now_s) <= self._timeout_s()
        )
        self._answered_ns = stamp_to_ns(message.header.stamp)
        self._last = TickInput(
            self._answered_ns, *sample, ball.position, ball.stamp_ns, present, order is Order.SET
        )
        self._act(self._last)

    def _tell_faults(self) -> None:
        if self._clocks.fault != self._told:
            self._told = self._clocks.fault
            if self._told:
                self._refuse(UserError(f"{self._told}; no stroke is played meanwhile"))

    def _refuse_several(self) -> None:
        infos = self._node.get_publishers_info_by_topic("joint_states")
        names = sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos)
        self._refuse(
            UserError(
                f"topic joint_states: {self.sources} sources tell of one arm ({', '.join(names)}); it "
                f"stops until there is one: end the others, or give each arm a namespace or domain"
            )
        )
        self._distrust()
