"""Stamps that stand still, go back, jump, or are of another clock than those of the other topic."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.samples import StrokeSamples, Track
from msrd_ros.recordings.verdict import Finding, Refusal

_FASTER = 10
"""A stamp that gains so much more than reception has jumped; simulations seldom run so fast."""


def check_clocks(samples: StrokeSamples, launch_ns: int, limits: InspectionLimits) -> Iterator[Finding]:
    """What is wrong with the stamps of a stroke.

    Parameters
    ----------
    samples
        Both topics.
    launch_ns
        Log time of the launch: what paused before does not count.
    limits
        What is accepted.
    """
    faults = [
        finding
        for track in (samples.joints, samples.ball)
        if len(track) > 1
        for finding in _check_stamps(track, launch_ns, limits)
    ]
    yield from faults
    if not faults and len(samples.joints) and len(samples.ball):
        yield from _check_offset(samples.joints, samples.ball, limits)


def _check_stamps(track: Track, launch_ns: int, limits: InspectionLimits) -> Iterator[Finding]:
    step_s = np.diff(track.time_ns) / 1e9
    passed_s = np.diff(track.received_ns) / 1e9
    in_flight = track.log_ns[1:] >= launch_ns
    back = step_s < -limits.disorder_s
    # What follows a jump is older again, if it was one stamp's.
    returns = np.minimum.accumulate(track.time_ns[::-1])[::-1][1:] < track.time_ns[1:]
    forward = (step_s > limits.clock_jump_s) & (step_s > _FASTER * passed_s) & (in_flight | returns)
    wrong = np.flatnonzero(back | forward)
    if wrong.size:
        row = int(wrong[0])
        way = "jumps by" if forward[row] else "goes back by"
        yield Finding(
            Refusal.BAD_CLOCK,
            f"the stamp of {track.role} {way} {abs(float(step_s[row])):.3f} s within {passed_s[row]:.3g} s "
            f"(was a clock set, are there two sources, or is it one faulty stamp?)",
            int(track.message[row + 1]),
        )
        return
    # A simulator that waits for an answer tells the same tick once more; a clock that stands tells of news,
    # and more than once: a ball has one stamp where it is launched and in the first picture of its flight.
    waits = (track.values[1:] == track.values[:-1]).all(axis=1) & (passed_s > limits.joint_gap_s)
    still_s = np.where((step_s == 0.0) & ~waits, passed_s, 0.0)
    begins = np.flatnonzero(np.diff(np.append(0.0, still_s > 0.0)) > 0)
    for row in begins.tolist():
        stop = row + int(np.append(still_s[row:], 0.0).argmin())
        if stop - row > 1 and still_s[row:stop].sum() > limits.joint_gap_s:
            yield Finding(
                Refusal.BAD_CLOCK,
                f"the stamps of {track.role} stand still for {still_s[row:stop].sum():.3f} s while it goes "
                f"on (does its source have a clock?)",
                int(track.message[row]),
            )
            return


def _check_offset(joints: Track, ball: Track, limits: InspectionLimits) -> Iterator[Finding]:
    """A ball position is about as old as the joint state that came in before it."""
    before = np.searchsorted(joints.received_ns, ball.received_ns, side="right") - 1
    known = before >= 0
    if not known.any():
        return
    ahead_s = (ball.time_ns[known] - joints.time_ns[before[known]]) / 1e9
    nearest = int(np.abs(ahead_s).argmin())
    if abs(ahead_s[nearest]) > limits.clock_s:
        way = "ahead of" if ahead_s[nearest] > 0.0 else "behind"
        yield Finding(
            Refusal.BAD_CLOCK,
            f"the stamps of {ball.role} are at least {abs(float(ahead_s[nearest])):.3f} s {way} those of "
            f"{joints.role} (set both computers by one clock)",
            int(ball.message[known.argmax()]),
        )
