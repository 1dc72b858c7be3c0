"""Deciding whether a stroke may serve as a demonstration, and labelling the stored joint states."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.schemas import deserialise, serialise
from msrd_ros.bags.strokes import Stroke
from msrd_ros.contract.outcome import RETURNED
from msrd_ros.contract.topics import BALL_POSITION, CONTRACT, FEED, JOINT_STATES, STRATEGY, BagMessage
from msrd_ros.contract.translation import JointStateTranslator, read_ball_position, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.robots.robot import Robot


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
    JOINT_GAP = "joint_gap"
    BALL_STALE = "ball_stale"
    JOINT_SPEED = "joint_speed"
    STOPPED = "stopped"
    DISCARDED = "discarded"
    DISK_FULL = "disk_full"
    WRITE_FAILED = "write_failed"


class Verdict(NamedTuple):
    """What is thought of a stroke.

    Attributes
    ----------
    reason
        Empty if it is accepted; else a miss reason or a `Refusal`.
    detail
        What was found, for a person.
    """

    reason: str = ""
    detail: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the stroke may serve as a demonstration."""
        return not self.reason


@dataclass(frozen=True)
class InspectionLimits:
    """What is still accepted.

    Attributes
    ----------
    speed_tolerance
        Joint speed as a fraction of its limit, at any sample.
    joint_gap_s, ball_gap_s
        Longest time between two samples from the launch to the outcome, and from the launch to the first.
    launch_m
        How far from where it was fed the ball is seen first, m.
    """

    speed_tolerance: float = 1.01
    joint_gap_s: float = 0.1
    ball_gap_s: float = 0.25
    launch_m: float = 0.5


def inspect(stroke: Stroke, robot: Robot, limits: InspectionLimits) -> Verdict:
    """Accept a stroke of an arm, or say why not: the first reason found, gravest first."""
    if not stroke.outcome:
        return Verdict(Refusal.BAD_OUTCOME, "rally/outcome holds no status named rally with a message")
    if stroke.outcome != RETURNED:
        return Verdict(stroke.outcome, "the ball was not returned")
    if stroke.label is None:
        return Verdict(Refusal.NO_LABEL, "no strategy was set; publish its label on strategy")
    joints = [message for message in stroke.messages if message.topic == JOINT_STATES]
    balls = [message for message in stroke.messages if message.topic == BALL_POSITION]
    if not joints:
        return Verdict(Refusal.NO_JOINT_STATES, "nothing came on joint_states")
    if not balls:
        return Verdict(Refusal.NO_BALL, "nothing came on ball/position")
    conflict = _conflicting_label(stroke)
    if conflict:
        return Verdict(Refusal.LABEL_CONFLICT, conflict)
    if stroke.lost:
        return Verdict(Refusal.MESSAGES_LOST, f"{stroke.lost} messages were lost on their way")
    return _inspect_motion(stroke, robot, joints, balls, limits)


def label_joint_states(stroke: Stroke) -> tuple[BagMessage, ...]:
    """The stroke's messages with its label in the joint states' headers.

    A source that labels its joint states itself is left alone. One that does not (ros2_control's
    broadcaster writes a frame of its own) gets the label into every one, in this copy only.
    """
    label = str(stroke.label)
    frames = {read_frame_id(message.data) for message in stroke.messages if message.topic == JOINT_STATES}
    if label in frames:
        return stroke.messages
    return tuple(
        message._replace(data=_with_frame(message.data, label)) if message.topic == JOINT_STATES else message
        for message in stroke.messages
    )


def _with_frame(data: bytes, frame_id: str) -> bytes:
    type_name = CONTRACT[JOINT_STATES].type_name
    message = deserialise(data, type_name)
    message.header.frame_id = frame_id
    return serialise(message, type_name)


def _conflicting_label(stroke: Stroke) -> str:
    for message in stroke.messages:
        if message.topic == STRATEGY and read_frame_id(message.data) != stroke.label:
            return f"{STRATEGY} says {read_frame_id(message.data)!r}, the stroke is {stroke.label}"
    return ""


def _inspect_motion(
    stroke: Stroke,
    robot: Robot,
    joints: list[BagMessage],
    balls: list[BagMessage],
    limits: InspectionLimits,
) -> Verdict:
    translator = JointStateTranslator(robot)
    joint_times, velocities = [], []
    try:
        for item in joints:
            message = _read(item, JOINT_STATES)
            joint_times.append(stamp_to_ns(message.header.stamp))
            velocities.append(translator.read(message)[1])
    except UserError as error:
        return Verdict(Refusal.BAD_JOINT_STATES, str(error))
    ball_times = []
    try:
        for item in balls:
            message = _read(item, BALL_POSITION)
            ball_times.append(stamp_to_ns(message.header.stamp))
            read_ball_position(message)
    except UserError as error:
        return Verdict(Refusal.BAD_BALL, str(error))
    gap_s = _longest_gap_s(stroke, joints, joint_times, stroke.messages[0].log_time_ns)
    if gap_s > limits.joint_gap_s:
        return Verdict(Refusal.JOINT_GAP, f"joint_states paused for {gap_s:.3f} s")
    # Who begins to listen in mid-flight has heard no pause: only the referee tells when the launch was.
    missed_s = stroke.flight_s - (stroke.end_ns - joints[0].log_time_ns) / 1e9
    if missed_s > limits.joint_gap_s:
        return Verdict(
            Refusal.LAUNCH_MISSED,
            f"joint_states were first heard {missed_s:.3f} s after the launch; start to record before it",
        )
    # A ball that a person throws is in nobody's sight before.
    fed = any(message.topic == FEED for message in stroke.messages)
    strayed_m = _flown_unseen_m(stroke, balls[0])
    if strayed_m > limits.launch_m:
        return Verdict(
            Refusal.LAUNCH_MISSED,
            f"the ball was first seen {strayed_m:.2f} m from where it was fed; start to record before it",
        )
    gap_s = _longest_gap_s(stroke, balls, ball_times, stroke.launch_ns if fed else balls[0].log_time_ns)
    if gap_s > limits.ball_gap_s:
        return Verdict(Refusal.BALL_STALE, f"ball/position paused for {gap_s:.3f} s")
    return _inspect_speed(robot, np.array(velocities), np.array(joint_times), limits)


def _flown_unseen_m(stroke: Stroke, first: BagMessage) -> float:
    """How far from the place of its feed the ball was when it was first seen, m; 0 where nobody fed it."""
    feeds = [message for message in stroke.messages if message.topic == FEED]
    if not feeds:
        return 0.0
    place = _read(feeds[-1], FEED).pose.pose.position
    seen = read_ball_position(_read(first, BALL_POSITION))
    return float(np.linalg.norm(seen - np.array([place.x, place.y, place.z])))


def _read(message: BagMessage, role: str) -> Any:
    return deserialise(message.data, CONTRACT[role].type_name)


def _longest_gap_s(stroke: Stroke, messages: list[BagMessage], stamps_ns: list[int], begin_ns: int) -> float:
    """Longest time without a new sample: by stamps in flight, by arrival from `begin_ns` and to the end."""
    times = [message.log_time_ns for message in messages]
    ends = max(min(times) - begin_ns, stroke.end_ns - max(times), 0)
    stamps, first = np.unique(stamps_ns, return_index=True)
    # The pause before a sample counts if the sample came in flight; what paused before the launch does not.
    in_flight = np.array(times)[first][1:] >= stroke.launch_ns
    between = np.diff(stamps)[in_flight].max(initial=0)
    return float(max(ends, between)) / 1e9


def _inspect_speed(
    robot: Robot, velocity: NDArray[np.float64], times_ns: NDArray[np.int64], limits: InspectionLimits
) -> Verdict:
    fraction = np.abs(velocity) / robot.limits.speed_rad_s
    worst, joint = np.unravel_index(int(fraction.argmax()), fraction.shape)
    if fraction[worst, joint] <= limits.speed_tolerance:
        return Verdict()
    since_s = float(times_ns[worst] - times_ns[0]) / 1e9
    return Verdict(
        Refusal.JOINT_SPEED,
        f"{robot.joint_names[joint]} ran at {100 * fraction[worst, joint]:.1f} % of its speed limit, "
        f"{since_s:.2f} s into the stroke",
    )
