"""The one translation between robot messages and learner arrays.

Bags on disk, bags being played, rollouts over topics and the live executor all read messages with the
functions and classes below, so that the same motion gives the same arrays whichever way it came. Messages
are taken by their fields alone: rclpy's classes and those of a bag reader serve alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S, HORIZON, Episode
from msrd_ros.contract.joint_states import JointStateTranslator as JointStateTranslator
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.stamps import NANOSECONDS as NANOSECONDS
from msrd_ros.contract.stamps import ns_to_stamp as ns_to_stamp
from msrd_ros.contract.stamps import stamp_to_ns as stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot

FEED_SPEED_M_S = 2.5
"""A ball on the far half that comes towards the robot faster than this has been fed."""

RESTING_SPEED_M_S = 0.5
"""A ball that comes towards the robot slower than this is not on its way; above a camera's noise."""

ANOTHER_BALL_M_S = 20.0
"""Samples further apart than a ball can fly are of two balls: the old one is gone, a new one is ready."""


def read_ball_position(message: Any, where: str = "topic ball/position") -> NDArray[np.float64]:
    """Position (3,) in m from geometry_msgs/PointStamped.

    Raises
    ------
    UserError
        If a coordinate is not finite.
    """
    position = np.array([message.point.x, message.point.y, message.point.z])
    if not np.isfinite(position).all():
        raise UserError(f"{where}: position {position} is not finite; check the camera")
    return position


RALLY_STATUS = "rally"
"""Name of the status in rally/outcome that holds the referee's decision."""


def read_outcome(message: Any, where: str = "topic rally/outcome") -> tuple[StrategyLabel | None, Outcome]:
    """The strategy that was played and the referee's decision, from diagnostic_msgs/DiagnosticArray.

    Raises
    ------
    UserError
        If the label is unknown or the decision cannot be read.
    """
    text = message.header.frame_id
    label = StrategyLabel.parse(text, where) if text else None
    for item in message.status:
        if item.name == RALLY_STATUS:
            values = {pair.key: pair.value for pair in item.values}
            return label, Outcome.from_values(item.message, values, where)
    raise UserError(
        f"{where}: no status named {RALLY_STATUS!r}; publish the referee's decision under that name"
    )


class BallTracker:
    """Turns ball samples into position and velocity as a policy sees them.

    The velocity is the difference of the last two different samples over their stamps; zero while there
    is only one. The ball counts as fed from the first sample on the far half (x > 0) that comes towards
    the robot faster than `FEED_SPEED_M_S`, until it comes no nearer or another ball takes its place. (A
    returned ball may end near where the next one lies ready, so that no jump tells them apart.)
    """

    def __init__(self) -> None:
        self.position: NDArray[np.float64] = np.zeros(3)
        self.velocity: NDArray[np.float64] = np.zeros(3)
        self.fed = False
        self.stamp_ns = -1

    def add(self, position: NDArray[np.float64], stamp_ns: int) -> None:
        """Take the newest sample; one with an old stamp (no new camera frame) changes nothing."""
        if stamp_ns <= self.stamp_ns:
            return
        if self.stamp_ns >= 0:
            self.velocity = (position - self.position) * (NANOSECONDS / (stamp_ns - self.stamp_ns))
            if float(self.velocity @ self.velocity) > ANOTHER_BALL_M_S**2:
                self.velocity = np.zeros(3)
                self.fed = False
            elif self.velocity[0] > -RESTING_SPEED_M_S:
                self.fed = False
            elif position[0] > 0.0 and self.velocity[0] < -FEED_SPEED_M_S:
                self.fed = True
        self.position, self.stamp_ns = position, stamp_ns


class EpisodeAssembler:
    """Collects the messages of one stroke and samples them at the control rate.

    Time zero is the last joint state before the ball was seen flying. Joint states are interpolated; of the
    ball the newest sample that had arrived by each tick counts, as it does for the live executor.
    """

    def __init__(
        self,
        label: StrategyLabel | None,
        subject: str = "",
        source: str = "topics",
        robot: Robot | None = None,
    ) -> None:
        self._robot = robot or default_robot()
        self._label = label
        self._subject = subject
        self._source = source
        self._joints = JointStateTranslator(self._robot, f"{source}: joint_states")
        self._joint_rows: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = []
        self._ball_rows: list[tuple[int, NDArray[np.float64]]] = []
        self._outcome: Outcome | None = None

    def add_joint_state(self, message: Any) -> None:
        """Take a sensor_msgs/JointState; one that does not tell the arm's state is passed over."""
        sample = self._joints.sample(message)
        if sample is not None:
            self.add_joints(stamp_to_ns(message.header.stamp), *sample)

    def add_ball_position(self, message: Any) -> None:
        """Take a geometry_msgs/PointStamped."""
        position = read_ball_position(message, f"{self._source}: ball/position")
        self.add_ball(stamp_to_ns(message.header.stamp), position)

    def add_outcome(self, message: Any) -> None:
        """Take the diagnostic_msgs/DiagnosticArray of rally/outcome."""
        _, self._outcome = read_outcome(message, f"{self._source}: rally/outcome")

    def add_joints(self, time_ns: int, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        """Take joint positions and velocities, (N,) each; a time that is not new is passed over."""
        if not self._joint_rows or time_ns > self._joint_rows[-1][0]:
            self._joint_rows.append((time_ns, position, velocity))

    def add_ball(self, time_ns: int, position: NDArray[np.float64]) -> None:
        """Take a ball position (3,); a time that is not new is passed over."""
        if not self._ball_rows or time_ns > self._ball_rows[-1][0]:
            self._ball_rows.append((time_ns, position))

    def assemble(self, horizon: int = HORIZON, period_s: float = CONTROL_PERIOD_S) -> Episode:
        """The stroke as arrays.

        Parameters
        ----------
        horizon
            Number of steps T; the arrays have T + 1 rows.
        period_s
            Control period in seconds.

        Raises
        ------
        UserError
            If there is nothing to assemble, the ball never flies, or the recording ends too early.
        """
        if len(self._joint_rows) < 2 or len(self._ball_rows) < 2:
            raise UserError(
                f"{self._source}: {len(self._joint_rows)} joint states and {len(self._ball_rows)} ball "
                f"positions are too few for a stroke; record joint_states and ball/position"
            )
        joint_times = np.array([row[0] for row in self._joint_rows], dtype=np.int64)
        start = self._launch_ns(joint_times)
        ticks = start + np.round(np.arange(horizon + 1) * period_s * NANOSECONDS).astype(np.int64)
        # The last tick may fall between two samples of the recording's end.
        period_ns = int(period_s * NANOSECONDS)
        if ticks[-1] > joint_times[-1] + period_ns:
            raise UserError(
                f"{self._source}: the recording ends {(joint_times[-1] - start) / NANOSECONDS:.2f} s after "
                f"the launch; {horizon * period_s:.2f} s are needed, so record on until the ball is down"
            )
        positions = self._interpolate(ticks, joint_times, 1)
        velocities = self._interpolate(ticks, joint_times, 2)
        ball_position, ball_velocity = self._track_ball(ticks)
        return Episode(
            self._label,
            positions,
            velocities,
            ball_position,
            ball_velocity,
            self._subject,
            self._source,
            self._outcome,
            self._robot,
            start,
        )

    def _launch_ns(self, joint_times: NDArray[np.int64]) -> int:
        tracker = BallTracker()
        before = self._ball_rows[0][0]
        for time_ns, position in self._ball_rows:
            tracker.add(position, time_ns)
            if tracker.fed:
                index = int(np.searchsorted(joint_times, before, side="right")) - 1
                return int(joint_times[max(index, 0)])
            before = time_ns
        raise UserError(f"{self._source}: the ball never flies towards the robot; record the whole rally")

    def _interpolate(
        self, ticks: NDArray[np.int64], times: NDArray[np.int64], column: int
    ) -> NDArray[np.float64]:
        values = np.array([row[column] for row in self._joint_rows])
        since = (times - times[0]).astype(np.float64)
        wanted = (ticks - times[0]).astype(np.float64)
        return np.stack(
            [np.interp(wanted, since, values[:, j]) for j in range(self._robot.joint_count)], axis=1
        )

    def _track_ball(self, ticks: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        stamps = np.array([row[0] for row in self._ball_rows], dtype=np.int64)
        newest = np.maximum(np.searchsorted(stamps, ticks, side="right") - 1, 0)
        tracker = BallTracker()
        position = np.empty((len(ticks), 3))
        velocity = np.empty((len(ticks), 3))
        for step, index in enumerate(newest):
            tracker.add(self._ball_rows[index][1], int(stamps[index]))
            position[step], velocity[step] = tracker.position, tracker.velocity
        return position, velocity
