"""What an arm cannot have done: angles, speeds, accelerations and jumps that its joints do not have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.samples import Track
from msrd_ros.recordings.verdict import Finding, Refusal
from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]

_ROUND_RAD = 2.0 * np.pi


def check_joints(track: Track, told: bool, robot: Robot, limits: InspectionLimits) -> Iterator[Finding]:
    """What is wrong with the motion of the joints.

    Parameters
    ----------
    track
        Joint states, the newest last, n of them.
    told
        Whether the driver itself told velocities.
    robot, limits
        What they are held against.
    """
    yield from _check_limits(track, robot, limits)
    if len(track) < 2:
        return
    time_s = (track.time_ns - track.time_ns[0]) / 1e9
    yield from _check_jumps(track, time_s, robot, limits)
    yield from _check_speed(track, time_s, told, robot, limits)
    yield from _check_acceleration(track, time_s, robot, limits)
    if told:
        yield from _check_velocity(track, time_s, robot, limits)


def _check_limits(track: Track, robot: Robot, limits: InspectionLimits) -> Iterator[Finding]:
    lower, upper = robot.limits.lower_rad, robot.limits.upper_rad
    beyond = np.maximum(lower - track.values, track.values - upper)
    row, joint, worst = _worst(beyond)
    if worst <= limits.position_slack_rad:
        return
    angle = float(track.values[row, joint])
    limit = float(lower[joint] if angle < lower[joint] else upper[joint])
    yield Finding(
        Refusal.JOINT_LIMIT,
        f"joint {robot.joint_names[joint]} is at {angle:.4g} rad, beyond its limit of {limit:.4g} rad "
        f"({_limit_hint(track.values, lower, upper)})",
        int(track.message[row]),
    )


def _limit_hint(values: Array, lower: Array, upper: Array) -> str:
    turned = np.radians(values)
    if np.abs(values).max() > _ROUND_RAD and ((turned >= lower - 0.05) & (turned <= upper + 0.05)).all():
        return "are these degrees?"
    outside = ((values < lower) | (values > upper)).any(axis=1).mean()
    return "a faulty sensor?" if outside < 0.5 else "joints in another order, or of another arm?"


def _check_jumps(track: Track, time_s: Array, robot: Robot, limits: InspectionLimits) -> Iterator[Finding]:
    step = np.abs(np.diff(track.values, axis=0))
    spacing_s = np.diff(time_s)[:, None]
    beyond = step - robot.limits.speed_rad_s * (spacing_s + limits.jump_s)
    row, joint, worst = _worst(beyond)
    if worst <= 0.0:
        return
    others = int((beyond[row] > 0.0).sum()) - 1
    jump = float(step[row, joint])
    hint = "a faulty sensor?"
    if abs(jump - _ROUND_RAD) < 0.2:
        hint = "is the angle counted round by round?"
    elif others:
        hint = f"{others} more jump with it: joints in another order, or two sources?"
    yield Finding(
        Refusal.JOINT_JUMP,
        f"joint {robot.joint_names[joint]} jumps by {jump:.3g} rad within {float(spacing_s[row, 0]):.3g} s "
        f"({hint})",
        int(track.message[row + 1]),
    )


def _check_speed(
    track: Track, time_s: Array, told: bool, robot: Robot, limits: InspectionLimits
) -> Iterator[Finding]:
    """The speed that the driver tells at any sample, and the mean speed of positions over a short while."""
    rows, ends = _windows(time_s, limits.window_s)
    moved = (track.values[ends] - track.values[rows]) / (time_s[ends] - time_s[rows])[:, None]
    for velocity, tolerance, numbers in (
        (track.velocity if told else track.velocity[:0], limits.speed_tolerance, np.arange(len(track))),
        (moved, limits.mean_speed_tolerance, rows),
    ):
        fraction = np.abs(velocity) / robot.limits.speed_rad_s
        row, joint, worst = _worst(fraction)
        if worst > tolerance:
            yield Finding(
                Refusal.JOINT_SPEED,
                f"joint {robot.joint_names[joint]} ran at {100 * worst:.1f} % of its speed limit",
                int(track.message[numbers[row]]),
            )
            return


def _check_acceleration(
    track: Track, time_s: Array, robot: Robot, limits: InspectionLimits
) -> Iterator[Finding]:
    rows, ends = _windows(time_s, limits.window_s)
    change = (track.velocity[ends] - track.velocity[rows]) / (time_s[ends] - time_s[rows])[:, None]
    fraction = np.abs(change) / robot.limits.acceleration_rad_s2
    row, joint, worst = _worst(fraction)
    if worst > limits.acceleration_tolerance:
        yield Finding(
            Refusal.JOINT_ACCELERATION,
            f"joint {robot.joint_names[joint]} changes its speed by {float(change[row, joint]):.4g} rad/s^2, "
            f"{worst:.1f} times its limit (did it freeze, or was time lost?)",
            int(track.message[rows[row]]),
        )


def _check_velocity(track: Track, time_s: Array, robot: Robot, limits: InspectionLimits) -> Iterator[Finding]:
    """Positions must go where the velocities say."""
    rows, ends = _windows(time_s, limits.agreement_window_s)
    mean = 0.5 * (track.velocity[1:] + track.velocity[:-1]) * np.diff(time_s)[:, None]
    travelled = np.concatenate([np.zeros((1, track.values.shape[1])), np.cumsum(mean, axis=0)])
    told = travelled[ends] - travelled[rows]
    went = track.values[ends] - track.values[rows]
    allowed = robot.limits.speed_rad_s * limits.agreement_s + limits.agreement_rad
    row, joint, worst = _worst(np.abs(told - went) - allowed)
    if worst <= 0.0:
        return
    hint = "is one of them of another joint, or in degrees?"
    if not track.velocity[:, joint].any():
        hint = "does the driver fill in zeros? Left empty, velocities are taken from positions"
    elif abs(went[row, joint]) < 1e-9:
        hint = "is the joint frozen?"
    yield Finding(
        Refusal.JOINT_VELOCITY,
        f"joint {robot.joint_names[joint]} moves {float(went[row, joint]):.3g} rad in "
        f"{limits.agreement_window_s:g} s where its velocity says {float(told[row, joint]):.3g} rad ({hint})",
        int(track.message[rows[row]]),
    )


def _windows(time_s: Array, length_s: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last rows of all stretches that are at least so long, and hardly longer."""
    ends = np.searchsorted(time_s, time_s + length_s - 1e-9)
    rows = np.flatnonzero(ends < len(time_s))
    rows = rows[time_s[ends[rows]] - time_s[rows] < 2.5 * length_s]
    return rows, ends[rows]


def _worst(values: Array) -> tuple[int, int, float]:
    """Row, column and size of the largest value; minus infinity where there is none."""
    if not values.size:
        return 0, 0, -np.inf
    row, column = np.unravel_index(int(values.argmax()), values.shape)
    return int(row), int(column), float(values[row, column])
