"""What the topics tell, as a picture and as words."""

from __future__ import annotations

import math
import time
from collections import deque
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rcl_interfaces.msg import Log
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import (
    NANOSECONDS,
    JointStateTranslator,
    read_ball_position,
    read_outcome,
    stamp_to_ns,
)
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import EVENT
from msrd_ros.nodes.latched import hear_latched
from msrd_ros.nodes.polled import PolledTopic
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.scene import Picture
from msrd_ros.table_tennis.strokes.reach import read_point

ROSOUT = "/rosout"
"""Where every ROS node's log goes: a topic of ROS itself, not of this package."""
GONE_S = 3.0
"""A node that says nothing for so long is shown as gone."""
FORGET_S = 30.0
COMPLAINT_S = 15.0
_TRAIL_NS = round(1.2 * NANOSECONDS)
_FASTEST_M_S, _SLACK_M = 30.0, 0.05
"""A ball that came further than this since the last sample is another one."""
_WARNING = 30
"""Of rcl_interfaces/Log."""


class Rates(NamedTuple):
    """Balls of one strategy since the count began."""

    fed: int = 0
    struck: int = 0
    returned: int = 0

    def with_outcome(self, outcome: Outcome) -> Rates:
        """One ball more."""
        return Rates(self.fed + 1, self.struck + outcome.struck, self.returned + outcome.returned)


class _Complaint(NamedTuple):
    text: str
    heard_s: float


class Watch:
    """Listens to a stack, be it the simulator's, a real arm's or a bag that is played.

    Parameters
    ----------
    node
        Whose subscriptions they are.
    robot
        Whose joints are shown.
    """

    def __init__(self, node: Node, robot: Robot) -> None:
        self._translator = JointStateTranslator(robot)
        self._joints = PolledTopic(node, JointState, "joint_states", depth=4)
        self._ball = PolledTopic(node, PointStamped, "ball/position", depth=64)
        self._odometry = PolledTopic(node, Odometry, "ball/odometry")
        node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        node.create_subscription(Log, ROSOUT, self._on_log, EVENT)
        hear_latched(node, Header, "strategy", self._on_strategy)
        self._position: NDArray[np.float64] | None = None
        self._spin: NDArray[np.float64] | None = None
        self._trail: deque[tuple[int, NDArray[np.float64]]] = deque(maxlen=512)
        self._time_ns = 0
        self._playing = ""
        self._wanted = ""
        self._nodes: dict[str, tuple[DiagnosticStatus, float]] = {}
        self._complaints: dict[str, _Complaint] = {}
        self.rates: dict[str, Rates] = {}
        self.outcome: tuple[StrategyLabel | None, Outcome] | None = None
        self.decided = 0

    # -- pictures ------------------------------------------------------------------------------

    def picture(self) -> Picture:
        """What is to be seen now."""
        self._take_joints()
        self._take_ball()
        for message in self._odometry.take():
            angular = message.twist.twist.angular
            spin = np.array([angular.x, angular.y, angular.z])
            self._spin = spin if np.isfinite(spin).all() else None
        trail = np.array([position for _, position in self._trail]).reshape(-1, 3)
        ball = trail[-1] if len(trail) else None
        return Picture(self._position, ball, trail, self._spin, self._target())

    def _target(self) -> NDArray[np.float64] | None:
        """Where the executor says that it aims at."""
        return read_point(self.values("executor").get("target", ""))

    def _take_joints(self) -> None:
        for message in self._joints.take():
            try:
                sample = self._translator.sample(message)
            except UserError:
                continue  # the executor complains of it
            if sample is not None:
                self._position = sample.position
                self._playing = message.header.frame_id
                self._time_ns = stamp_to_ns(message.header.stamp)

    def _take_ball(self) -> None:
        for message in self._ball.take():
            try:
                position = read_ball_position(message)
            except UserError:
                continue
            stamp_ns = stamp_to_ns(message.header.stamp)
            if self._trail:
                last_ns, last = self._trail[-1]
                if stamp_ns == last_ns:
                    continue
                if stamp_ns < last_ns or _is_another(position - last, stamp_ns - last_ns):
                    self._trail.clear()
            self._trail.append((stamp_ns, position))
        while self._trail and self._trail[-1][0] - self._trail[0][0] > _TRAIL_NS:
            self._trail.popleft()

    # -- words ---------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """What is told beside the picture, as JSON has it."""
        now_s = time.monotonic()
        return {
            "time_s": self._time_ns / NANOSECONDS,
            "playing": self._playing,
            "wanted": self._wanted,
            "spin_rad_s": None if self._spin is None else round(float(np.linalg.norm(self._spin)), 1),
            "verdict": self._verdict(),
            "decided": self.decided,
            "rates": {label: rates._asdict() for label, rates in self.rates.items()},
            "nodes": [self._account(name, now_s) for name in sorted(self._nodes)],
        }

    def is_alive(self, name: str) -> bool:
        """Whether a node of this name (without namespace) has been heard of lately."""
        return self._alive(name) is not None

    def values(self, name: str) -> dict[str, str]:
        """What the node of this name says of itself in /diagnostics; nothing if it is gone."""
        status = self._alive(name)
        return {pair.key: pair.value for pair in status.values} if status is not None else {}

    def _alive(self, name: str) -> DiagnosticStatus | None:
        """The newest status of a node that has been heard of lately."""
        now_s = time.monotonic()
        for full, (status, heard_s) in self._nodes.items():
            if full.rpartition("/")[2] == name and now_s - heard_s < GONE_S:
                return status
        return None

    def forget_rates(self) -> None:
        """Begin to count anew."""
        self.rates.clear()

    def _verdict(self) -> dict[str, Any] | None:
        if self.outcome is None:
            return None
        label, outcome = self.outcome
        numbers = (outcome.landing_x_m, outcome.landing_y_m, outcome.spin_y_rad_s)
        x, y, spin = (round(value, 3) if math.isfinite(value) else None for value in numbers)
        return {
            "strategy": str(label or ""),
            "text": outcome.message,
            "returned": outcome.returned,
            "landing_m": None if x is None else [x, y],
            "spin_rad_s": spin,
        }

    def _account(self, name: str, now_s: float) -> dict[str, Any]:
        status, heard_s = self._nodes[name]
        values = {pair.key: pair.value for pair in status.values}
        complaint = self._complaints.get(name)
        said = complaint.text if complaint and now_s - complaint.heard_s < COMPLAINT_S else ""
        return {
            "name": name,
            "alive": now_s - heard_s < GONE_S,
            "message": status.message,
            "waits_for": values.get("waits_for", ""),
            "complaint": said,
        }

    # -- what comes in -------------------------------------------------------------------------

    def _on_strategy(self, message: Header) -> None:
        self._wanted = message.frame_id

    def _on_outcome(self, message: DiagnosticArray) -> None:
        try:
            label, outcome = read_outcome(message)
        except UserError:
            return  # whoever decides by it complains
        self.outcome = label, outcome
        self.decided += 1
        name = str(label or "")
        self.rates[name] = self.rates.get(name, Rates()).with_outcome(outcome)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s = time.monotonic()
        for item in message.status:
            self._nodes[item.name] = item, now_s
        for name in [name for name, (_, heard_s) in self._nodes.items() if now_s - heard_s > FORGET_S]:
            del self._nodes[name]

    def _on_log(self, message: Log) -> None:
        level = message.level[0] if isinstance(message.level, bytes) else int(message.level)
        if level >= _WARNING:
            name = "/" + message.name.replace(".", "/")
            self._complaints[name] = _Complaint(message.msg, time.monotonic())


def _is_another(step_m: NDArray[np.float64], period_ns: int) -> bool:
    """Whether no ball can have come so far in this time."""
    return float(np.linalg.norm(step_m)) > _SLACK_M + _FASTEST_M_S * period_ns / NANOSECONDS
