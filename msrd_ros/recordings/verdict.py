"""What is thought of a stroke: accepted, or refused with all reasons and their places."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Refusal(StrEnum):
    """Why a returned ball's stroke is not kept; a ball not returned is refused with its miss reason."""

    BAD_OUTCOME = "bad_outcome"
    NO_LABEL = "no_label"
    LABEL_CONFLICT = "label_conflict"
    NO_JOINT_STATES = "no_joint_states"
    NO_BALL = "no_ball"
    MESSAGES_LOST = "messages_lost"
    LAUNCH_MISSED = "launch_missed"
    BAD_JOINT_STATES = "bad_joint_states"
    BAD_BALL = "bad_ball"
    BAD_CLOCK = "bad_clock"
    JOINT_GAP = "joint_gap"
    BALL_STALE = "ball_stale"
    JOINT_LIMIT = "joint_limit"
    JOINT_SPEED = "joint_speed"
    JOINT_ACCELERATION = "joint_acceleration"
    JOINT_JUMP = "joint_jump"
    JOINT_VELOCITY = "joint_velocity"
    PADDLE_ELSEWHERE = "paddle_elsewhere"
    BALL_ELSEWHERE = "ball_elsewhere"
    BALL_FLIGHT = "ball_flight"
    INCOMPLETE = "incomplete"
    STOPPED = "stopped"
    DISCARDED = "discarded"
    DISK_FULL = "disk_full"
    WRITE_FAILED = "write_failed"


class Finding(NamedTuple):
    """Something that is wrong with a stroke.

    Attributes
    ----------
    reason
        A miss reason or a `Refusal`.
    text
        What was found, for a person.
    message
        Number of the stroke's message that shows it; None where it has no place.
    """

    reason: str
    text: str
    message: int | None = None


class Verdict(NamedTuple):
    """What is thought of a stroke.

    Attributes
    ----------
    reason
        Empty if it is accepted; else the gravest miss reason or `Refusal`.
    detail
        All that was found, with its place, for a person.
    notes
        What is no fault, but should be known: what was passed over, or taken from elsewhere.
    """

    reason: str = ""
    detail: str = ""
    notes: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether the stroke may serve as a demonstration."""
        return not self.reason
