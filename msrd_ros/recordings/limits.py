"""What is still accepted of a stroke."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

SETTABLE = ("speed_tolerance", "joint_gap_s", "ball_gap_s")
"""What the recorder's parameters set; a bag says it in its `custom_data`, so that readers accept the same."""


@dataclass(frozen=True)
class InspectionLimits:
    """What is still accepted: far beyond what arms, cameras and balls do, and within what faults do.

    Attributes
    ----------
    speed_tolerance
        Joint speed that the driver tells as a fraction of its limit, at any sample.
    joint_gap_s, ball_gap_s
        Longest time between two samples from the launch to the outcome, and from the launch to the first.
    launch_m
        How far from where it was fed the ball is seen first, m.
    position_slack_rad
        Joint angle beyond its limit: encoders and stops are off by some hundredths.
    window_s
        Speeds of positions and accelerations are means over so long, so that an encoder's steps and jitter of
        stamps do not count: 0.001 rad and 1 ms are 3 % of a limit then.
    mean_speed_tolerance
        Speed of the positions, as a fraction of its limit.
    acceleration_tolerance
        Change of the speed as a multiple of the acceleration limit.
    jump_s
        Two successive positions may be as far apart as the joint moves at full speed in the time between them
        and this: messages are stamped late by some hundredths where a computer is busy.
    agreement_window_s, agreement_s, agreement_rad
        Positions must go where the velocities say, over so long, but for what a joint at full speed moves
        in `agreement_s` (filters lag) and some encoder steps.
    disorder_s
        A stamp may be older than the last by this: messages overtake each other.
    clock_jump_s, clock_s
        Longest jump of a stamp that is not a clock's, and how far the clocks of the two topics may differ.
    room_m, floor_m
        The ball is within these of the origin along x and y, no higher than the third, and no deeper than
        `floor_m`. A playing area is 14 m by 7 m, and 5 m high.
    ball_speed_m_s, ball_jump_m
        The hardest strokes ever measured are near 35 m/s; false detections lie farther away than this.
    flight_window_s, flight_slack_m_s2, flight_share
        The bend of the path over so long tells of gravity, drag and spin within this error, for a camera with
        5 mm of noise; what the ball meets makes it wrong, but only for a part of the flight.
    hit_s, paddle_m
        The paddle is that near to the place where the ball turns round, so long before or after it: the blade
        has a radius of 0.08 m, and a ball moves 0.1 m between two frames of a slow camera.
    aslant_deg, bounce
        How far from the blade's normal the ball's velocity changes (rubber grips: 15 degrees in our own
        strokes), and its speed off the blade over that towards it (0.5 to 0.9).
    """

    speed_tolerance: float = 1.01
    joint_gap_s: float = 0.1
    ball_gap_s: float = 0.25
    launch_m: float = 0.5
    position_slack_rad: float = 0.05
    window_s: float = 0.04
    mean_speed_tolerance: float = 1.1
    acceleration_tolerance: float = 5.0
    jump_s: float = 0.03
    agreement_window_s: float = 0.2
    agreement_s: float = 0.05
    agreement_rad: float = 0.02
    disorder_s: float = 0.05
    clock_jump_s: float = 1.0
    clock_s: float = 0.2
    room_m: tuple[float, float, float] = (10.0, 10.0, 6.0)
    floor_m: float = 0.5
    ball_speed_m_s: float = 40.0
    ball_jump_m: float = 0.15
    flight_window_s: float = 0.15
    flight_slack_m_s2: float = 5.0
    flight_share: float = 0.7
    hit_s: float = 0.05
    paddle_m: float = 0.25
    aslant_deg: float = 50.0
    bounce: tuple[float, float] = (0.0, 2.0)

    @classmethod
    def of(cls, custom_data: Mapping[str, str]) -> InspectionLimits:
        """Those that a bag was recorded with, where it says so."""
        told: dict[str, Any] = {}
        for name in SETTABLE:
            try:
                told[name] = float(custom_data[name])
            except (KeyError, ValueError):
                continue  # nothing or nonsense: as usual
        return replace(cls(), **told)

    def settings(self) -> dict[str, str]:
        """What is not as usual, as it travels in a bag's `custom_data`."""
        usual = {field.name: field.default for field in fields(self)}
        return {name: repr(getattr(self, name)) for name in SETTABLE if getattr(self, name) != usual[name]}
