"""Whether the paddle was there, and turned so, that the ball came off it as it did.

What no limit of a joint shows is seen here: joints in another order, frozen joints, another arm, and clocks
or frames of robot and camera that differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.paddle import paddle_poses
from msrd_ros.recordings.samples import Track
from msrd_ros.recordings.verdict import Finding, Refusal
from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]

_TURNED_M = 0.5
"""A ball that has come so far back has been struck."""
_BEFORE_AND_AFTER_S = (0.01, 0.08)
"""Between these times from the hit the ball's velocity is measured."""
_SWING_S = 0.02
"""So long before and after the hit the paddle's velocity is measured."""
_HINT = "joints in another order, frozen or of another arm? clocks or frames apart?"


def check_hit(ball: Track, joints: Track, robot: Robot, limits: InspectionLimits) -> Iterator[Finding]:
    """What is wrong with the hit.

    Parameters
    ----------
    ball, joints
        From the launch to the decision, the newest last.
    robot, limits
        Whose paddle, and what is accepted.
    """
    if len(ball) < 2:
        return
    turn = int(ball.values[:, 0].argmin())
    if ball.values[turn:, 0].max() - ball.values[turn, 0] < _TURNED_M:
        return  # nobody struck it, as far as one can see
    since_s = (joints.time_ns - ball.time_ns[turn]) / 1e9
    near = np.flatnonzero(np.abs(since_s) <= limits.hit_s)
    if not near.size:
        return
    place, normal = paddle_poses(robot, joints.values)
    apart = np.linalg.norm(place[near] - ball.values[turn], axis=1)
    row = int(near[int(apart.argmin())])
    fault = ""
    if apart.min() > limits.paddle_m:
        fault = f"{float(apart.min()):.2f} m from the paddle"
    else:
        swing = _slope(since_s, place, np.abs(since_s - since_s[row]) <= _SWING_S)
        fault = _rebound_fault(ball, turn, normal[row], swing, limits)
    if fault:
        yield Finding(
            Refusal.PADDLE_ELSEWHERE,
            f"the ball turned round {fault} of {robot.name} ({_HINT})",
            int(ball.message[turn]),
        )


def _rebound_fault(
    ball: Track, turn: int, normal: Array, swing: Array | None, limits: InspectionLimits
) -> str:
    """What is wrong with how the ball came off a blade with this normal and velocity, (3,) each."""
    since_s = (ball.time_ns - ball.time_ns[turn]) / 1e9
    first, last = _BEFORE_AND_AFTER_S
    came = _slope(since_s, ball.values, (since_s <= -first) & (since_s >= -last))
    went = _slope(since_s, ball.values, (since_s >= first) & (since_s <= last))
    if came is None or went is None or swing is None:
        return ""  # a camera that is too slow for this
    change = went - came
    along = abs(float(change @ normal)) / float(np.linalg.norm(change))
    aslant_deg = math.degrees(math.acos(min(along, 1.0)))
    if aslant_deg > limits.aslant_deg:
        return f"{aslant_deg:.0f} degrees aslant to the blade"
    bounce = -float((went - swing) @ normal) / float((came - swing) @ normal)
    low, high = limits.bounce
    return "" if low < bounce < high else f"{bounce:.2g} times as fast as it met the blade"


def _slope(time_s: Array, values: Array, rows: NDArray[np.bool_]) -> Array | None:
    """Mean velocity (3,) over some rows; None where they are too few."""
    if rows.sum() < 3:
        return None
    return np.asarray(np.polyfit(time_s[rows], values[rows], 1)[0])
