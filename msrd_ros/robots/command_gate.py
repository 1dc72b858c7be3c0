"""The last look at a command before it is sent: nothing beyond an arm's limits passes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.robot import Robot

ROUNDING = 1e-9
SLACK_RAD = 0.02
"""So far beyond its limits a joint at its stop may be measured."""

Array = NDArray[np.float64]


class Waypoint(NamedTuple):
    """A state of the joints, (N,) in rad and rad/s, and how many seconds after the command it is reached."""

    time_s: float
    position: Array
    velocity: Array


def command_points(robot: Robot, reference: JointReference, period_s: float) -> list[Waypoint]:
    """A commanded state, reached after one period, and how the arm then comes to rest if nothing follows.

    Each joint decelerates at its limit. Between two points the velocities are linear in time, so that the
    cubic through them is this very motion. There is one point alone if the state is one of rest.

    Parameters
    ----------
    robot
        Whose limits hold; N joints.
    reference
        The commanded state, shape (N,).
    period_s
        Control period in seconds.
    """
    points = [Waypoint(period_s, reference.position, reference.velocity)]
    acceleration = robot.limits.acceleration_rad_s2
    stopping_s = np.abs(reference.velocity) / acceleration
    # Shorter than a nanosecond there is no time in a message. Rounded so, some become a little less.
    rest_s = np.ceil(stopping_s / ROUNDING) * ROUNDING
    for time_s in np.unique(rest_s[stopping_s > 0.0]):
        braking_s = np.minimum(stopping_s, time_s)
        change = np.sign(reference.velocity) * acceleration * braking_s
        velocity = np.where(rest_s > time_s, reference.velocity - change, 0.0)
        position = reference.position + (reference.velocity - 0.5 * change) * braking_s
        points.append(Waypoint(period_s + float(time_s), position, velocity))
    return points


class CommandGate:
    """Compares every point of a command with the limits and with the state that was sent before it.

    What does not pass is not sent at all: a command that is cut to fit would hide that something is wrong.

    Parameters
    ----------
    robot
        Whose limits hold; N joints.

    Attributes
    ----------
    last
        The state that was sent last; None if there is none to go on from.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.last: JointReference | None = None

    def require(self, points: Sequence[Waypoint]) -> None:
        """Let a command pass.

        Parameters
        ----------
        points
            The first one is the state to be reached, the others bring the arm to rest.

        Raises
        ------
        UserError
            Names joint, value and limit.
        """
        before = None if self.last is None else Waypoint(0.0, *self.last)
        for point in points:
            self._require_within(point)
            if before is not None:
                self._require_step(before, point)
            before = point
        if np.any(points[-1].velocity):
            raise UserError("a command does not end at rest; it is not sent")
        self.last = JointReference(points[0].position.copy(), points[0].velocity.copy())

    def forget(self) -> None:
        """Begin anew: nothing has been sent for so long that the arm rests wherever it is now."""
        self.last = None

    def _require_within(self, point: Waypoint) -> None:
        limits = self._robot.limits
        # Written so that NaN fails, too.
        for value, low, high, unit in (
            (point.position, limits.lower_rad, limits.upper_rad, "rad"),
            (point.velocity, -limits.speed_rad_s, limits.speed_rad_s, "rad/s"),
        ):
            fits = (value >= low - ROUNDING) & (value <= high + ROUNDING)
            self._require(fits, value, np.where(value > 0.0, high, low), unit)

    def _require_step(self, before: Waypoint, point: Waypoint) -> None:
        limits = self._robot.limits
        period_s = point.time_s - before.time_s
        for change, limit, unit in (
            (point.position - before.position, limits.speed_rad_s, "rad/s"),
            (point.velocity - before.velocity, limits.acceleration_rad_s2, "rad/s^2"),
        ):
            # Rates from values that were rounded themselves; a short period makes much of little.
            fits = np.abs(change) <= limit * period_s * (1.0 + ROUNDING) + 10.0 * ROUNDING
            self._require(fits & (period_s > 0.0), change / max(period_s, ROUNDING), limit, unit)

    def _require(self, fits: NDArray[np.bool_], value: Array, limit: Array, unit: str) -> None:
        if fits.all():
            return
        joint = int(np.flatnonzero(~fits)[0])
        raise UserError(
            f"a command would take joint {self._robot.joint_names[joint]} to {value[joint]:.4g} {unit}, its "
            f"limit is {limit[joint]:.4g}; it is not sent, and the arm comes to rest"
        )


def require_possible(robot: Robot, position: Array, where: str) -> None:
    """Refuse a measured posture (N,) in rad in which the arm cannot be.

    Raises
    ------
    UserError
        Names joint, value and limit.
    """
    limits = robot.limits
    fits = (position >= limits.lower_rad - SLACK_RAD) & (position <= limits.upper_rad + SLACK_RAD)
    if not fits.all():
        joint = int(np.flatnonzero(~fits)[0])
        value = position[joint]
        limit = limits.upper_rad[joint] if value > 0.0 else limits.lower_rad[joint]
        raise UserError(
            f"{where}: joint {robot.joint_names[joint]} is at {value:.4g} rad, its limit is {limit:.4g}; the "
            f"arm does not move on it: are these degrees, or another arm's (robot:=)?"
        )
