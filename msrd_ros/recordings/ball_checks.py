"""What no ball can have done."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.samples import Track
from msrd_ros.recordings.verdict import Finding, Refusal

Array = NDArray[np.float64]

_GRAVITY_M_S2 = 9.81
_DRAG_AND_LIFT_1_M = 0.28
"""rho A C / (2 m) of a table tennis ball at C = 1: drag and lift together have less at any spin."""


def check_ball(track: Track, limits: InspectionLimits) -> Iterator[Finding]:
    """What is wrong with the flight of a ball.

    Parameters
    ----------
    track
        Ball positions from the launch to the decision, the newest last.
    limits
        What they are held against.
    """
    if len(track) < 2:
        return
    outside = list(_check_room(track, limits))
    yield from outside
    if outside:
        return
    time_s = (track.time_ns - track.time_ns[0]) / 1e9
    jumps = list(_check_jumps(track, time_s, limits))
    yield from jumps or _check_fall(track, time_s, limits)


def _check_room(track: Track, limits: InspectionLimits) -> Iterator[Finding]:
    x, y, z = limits.room_m
    low, high = np.array([-x, -y, -limits.floor_m]), np.array([x, y, z])
    outside = ((track.values < low) | (track.values > high)).any(axis=1)
    if not outside.any():
        return
    row = int(outside.argmax())
    small = track.values / 1000.0
    hint = "another frame, or a false detection?"
    if ((small >= low) & (small <= high)).all() and np.abs(track.values).max() > 100.0:
        hint = "are these millimetres?"
    place = ", ".join(f"{value:.4g}" for value in track.values[row])
    yield Finding(
        Refusal.BALL_ELSEWHERE,
        f"the ball is at ({place}) m, out of the room ({hint})",
        int(track.message[row]),
    )


def _check_jumps(track: Track, time_s: Array, limits: InspectionLimits) -> Iterator[Finding]:
    step = np.linalg.norm(np.diff(track.values, axis=0), axis=1)
    spacing_s = np.diff(time_s)
    beyond = step - limits.ball_speed_m_s * spacing_s - limits.ball_jump_m
    row = int(beyond.argmax())
    if beyond[row] > 0.0:
        yield Finding(
            Refusal.BALL_FLIGHT,
            f"the ball jumps by {float(step[row]):.2f} m within {float(spacing_s[row]):.3g} s (a false "
            f"detection, or two balls?)",
            int(track.message[row + 1]),
        )


def _check_fall(track: Track, time_s: Array, limits: InspectionLimits) -> Iterator[Finding]:
    """In most of its flight a ball falls as gravity, drag and spin have it, whatever it meets in between."""
    # Neighbouring windows tell the same: some ten of them cover each stretch.
    ends = np.searchsorted(time_s, time_s + limits.flight_window_s, side="right")
    excess, rows = [], []
    for row in range(0, len(time_s), max(1, int(np.median(ends - np.arange(len(ends)))) // 10)):
        end = int(ends[row])
        if end - row < 4 or end >= len(time_s):
            continue
        since = time_s[row:end] - time_s[row:end].mean()
        bend, speed, _ = np.polyfit(since, track.values[row:end], 2)
        pull = 2.0 * bend + np.array([0.0, 0.0, _GRAVITY_M_S2])
        allowed = _DRAG_AND_LIFT_1_M * float(speed @ speed) + limits.flight_slack_m_s2
        excess.append(float(np.linalg.norm(pull)) - allowed)
        rows.append(row)
    wrong = np.array(excess) > 0.0
    if wrong.sum() > limits.flight_share * len(rows):
        yield Finding(
            Refusal.BALL_FLIGHT,
            f"the ball does not fly as gravity, air and spin have it for {100 * wrong.mean():.0f} % of its "
            f"way (another clock, unit or frame, or no ball?)",
            int(track.message[rows[int(wrong.argmax())]]),
        )
