"""Deciding whether a stroke may serve as a demonstration, wherever it comes from: the one inspection."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.schemas import deserialise, with_frame
from msrd_ros.bags.strokes import Stroke
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import say_label
from msrd_ros.contract.outcome import RETURNED
from msrd_ros.contract.topics import (
    BALL_POSITION,
    CONTRACT,
    FEED,
    JOINT_STATES,
    LATCHED_TOPICS,
    OUTCOME,
    STRATEGY,
    BagMessage,
)
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.ball_checks import check_ball
from msrd_ros.recordings.clock_checks import check_clocks
from msrd_ros.recordings.hit_checks import check_hit
from msrd_ros.recordings.joint_checks import check_joints
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.samples import StrokeSamples, Track, read_samples
from msrd_ros.recordings.verdict import Finding, Refusal, Verdict
from msrd_ros.robots.robot import Robot


class Judgement(NamedTuple):
    """What became of a stroke: the verdict, and the demonstration if it is accepted."""

    verdict: Verdict
    episode: Episode | None = None


class Origin(NamedTuple):
    """Where a stroke comes from.

    Attributes
    ----------
    subject
        Who showed it.
    source
        What to blame in errors.
    start_ns
        Reception of the first message of its bag; None: places count from the stroke's own beginning, in its
        own time.
    """

    subject: str = ""
    source: str = "topics"
    start_ns: int | None = None


def inspect(stroke: Stroke, robot: Robot, limits: InspectionLimits) -> Verdict:
    """Accept a stroke of an arm, or say why not: all reasons, gravest first, each with its place in s."""
    return judge(stroke, robot, limits).verdict


def judge(stroke: Stroke, robot: Robot, limits: InspectionLimits, origin: Origin | None = None) -> Judgement:
    """Inspect a stroke of an arm, and make a demonstration of it if it is accepted.

    Whether a stroke without a label is wanted is not asked here: it is accepted like any other.
    """
    origin = origin or Origin()
    said = _check_said(stroke)
    if said is not None:
        return Judgement(Verdict(said.reason, said.text))
    samples = read_samples(stroke, robot)
    findings = samples.findings + _check_motion(stroke, samples, robot, limits)
    episode = None
    if not findings:
        try:
            episode = _assemble(stroke, samples, robot, origin)
        except UserError as error:
            findings.append(Finding(Refusal.INCOMPLETE, str(error).removeprefix(f"{origin.source}: ")))
    if not findings:
        return Judgement(Verdict(notes=tuple(samples.notes)), episode)
    detail = "; ".join(_placed(finding, stroke, origin.start_ns) for finding in findings)
    return Judgement(Verdict(findings[0].reason, detail, tuple(samples.notes)))


def label_joint_states(stroke: Stroke) -> tuple[BagMessage, ...]:
    """The stroke's messages with its label in the joint states' headers.

    A source that labels its joint states itself is left alone. One that does not (ros2_control's
    broadcaster writes a frame of its own) gets the label into every one, in this copy only; a stroke without
    a label stays as it is.
    """
    if stroke.label is None:
        return stroke.messages
    label = str(stroke.label)
    frames = {read_frame_id(message.data) for message in stroke.messages if message.topic == JOINT_STATES}
    if label in frames:
        return stroke.messages
    return tuple(
        message._replace(data=with_frame(message.data, CONTRACT[JOINT_STATES].type_name, label))
        if message.topic == JOINT_STATES
        else message
        for message in stroke.messages
    )


def _placed(finding: Finding, stroke: Stroke, start_ns: int | None) -> str:
    if finding.message is None:
        return finding.text
    if start_ns is None:
        since_ns = stroke.messages[finding.message].log_time_ns - stroke.messages[0].log_time_ns
    else:
        since_ns = stroke.received_ns[finding.message] - start_ns
    return f"at {since_ns / 1e9:.2f} s {finding.text}"


def _check_said(stroke: Stroke) -> Finding | None:
    """What referee and strategy say, and whether all that a stroke needs came in."""
    topics = {message.topic for message in stroke.messages}
    if stroke.outcome == "":
        return Finding(Refusal.BAD_OUTCOME, "rally/outcome holds no status named rally with a message")
    if stroke.outcome not in (None, RETURNED):
        return Finding(str(stroke.outcome), "the ball was not returned")
    if JOINT_STATES not in topics:
        return Finding(Refusal.NO_JOINT_STATES, "nothing came on joint_states")
    if BALL_POSITION not in topics:
        return Finding(Refusal.NO_BALL, "nothing came on ball/position")
    for message in stroke.messages:
        text = read_frame_id(message.data) if message.topic in (STRATEGY, OUTCOME) else ""
        if text and text != stroke.label:
            told = f"{message.topic} says {text!r}, the stroke is {say_label(stroke.label)}"
            return Finding(Refusal.LABEL_CONFLICT, told)
    if stroke.lost:
        return Finding(Refusal.MESSAGES_LOST, f"{stroke.lost} messages were lost on their way")
    return None


def _check_motion(
    stroke: Stroke, samples: StrokeSamples, robot: Robot, limits: InspectionLimits
) -> list[Finding]:
    """What is wrong with the samples; with clocks that are wrong nothing else can be told."""
    if not len(samples.joints) or not len(samples.ball):
        return []  # why they could not be read has been found already
    findings = list(check_clocks(samples, stroke.launch_ns, limits))
    joints, ball = samples.joints.rising(), samples.ball.rising()
    if findings:
        return findings + list(check_joints(joints, samples.told, robot, limits))[:1]
    findings += _check_pauses(stroke, samples, limits)
    findings += check_joints(joints, samples.told, robot, limits)
    flight = _between(ball, stroke.launch_ns, stroke.end_ns)
    faults = list(check_ball(flight, limits))
    return findings + (faults or list(check_hit(flight, joints, robot, limits)))


def _check_pauses(stroke: Stroke, samples: StrokeSamples, limits: InspectionLimits) -> Iterator[Finding]:
    """Pauses, and a launch that was missed."""
    joints, balls = samples.joints, samples.ball
    feeds = [message for message in stroke.messages if message.topic == FEED]
    begin_ns = next(message.log_time_ns for message in stroke.messages if message.topic not in LATCHED_TOPICS)
    gap_s, row = _longest_gap(stroke, joints, begin_ns)
    if gap_s > limits.joint_gap_s:
        yield Finding(Refusal.JOINT_GAP, f"joint_states paused for {gap_s:.3f} s", int(joints.message[row]))
    # Who begins to listen in mid-flight has heard no pause: only the referee tells when the launch was.
    missed_s = stroke.flight_s - (stroke.end_ns - int(joints.log_ns[0])) / 1e9
    if missed_s > limits.joint_gap_s:
        yield Finding(
            Refusal.LAUNCH_MISSED,
            f"joint_states were first heard {missed_s:.3f} s after the launch; start to record before it",
        )
    elif feeds:
        strayed_m = _flown_unseen_m(stroke, feeds[-1], balls)
        if strayed_m > limits.launch_m:
            yield Finding(
                Refusal.LAUNCH_MISSED,
                f"the ball was first seen {strayed_m:.2f} m from where it was fed; start to record before it",
            )
    # A ball that a person throws is in nobody's sight before; one that stands still in the air is not seen.
    balls = balls.select(_moves(balls, stroke.launch_ns))
    gap_s, row = _longest_gap(stroke, balls, stroke.launch_ns if feeds else int(balls.log_ns[0]))
    if gap_s > limits.ball_gap_s:
        yield Finding(Refusal.BALL_STALE, f"ball/position paused for {gap_s:.3f} s", int(balls.message[row]))


def _moves(track: Track, launch_ns: int) -> NDArray[np.bool_]:
    """Rows with a new place, and all from before the ball first moved."""
    changed = np.append(False, (track.values[1:] != track.values[:-1]).any(axis=1))
    flying = changed & (track.log_ns >= launch_ns)
    return changed | (np.arange(len(track)) < (flying.argmax() if flying.any() else len(track)))


def _flown_unseen_m(stroke: Stroke, feed: BagMessage, balls: Track) -> float:
    """How far from the place of its feed the ball was when it was first seen, m."""
    try:
        place = _read(feed, FEED).pose.pose.position
    except UserError:
        return 0.0  # a feed that cannot be read tells nothing
    seen = balls.values[max(int(np.searchsorted(balls.log_ns, stroke.launch_ns, side="right")) - 1, 0)]
    strayed_m = float(np.linalg.norm(seen - np.array([place.x, place.y, place.z])))
    return strayed_m if np.isfinite(strayed_m) else 0.0


def _read(message: BagMessage, role: str) -> Any:
    return deserialise(message.data, CONTRACT[role].type_name)


def _longest_gap(stroke: Stroke, track: Track, begin_ns: int) -> tuple[float, int]:
    """Longest time in s without a new sample: by stamps in flight, by arrival from `begin_ns` and to the end.

    Beside it the row at which it begins.
    """
    stamps, first = np.unique(track.time_ns, return_index=True)
    # The pause before a sample counts if the sample came in flight; what paused before the launch does not.
    in_flight = track.log_ns[first][1:] >= stroke.launch_ns
    between = np.where(in_flight, np.diff(stamps), 0)
    gaps = [
        (int(track.log_ns.min()) - begin_ns, 0),
        (stroke.end_ns - int(track.log_ns.max()), len(track) - 1),
    ]
    if between.size:
        gaps.append((int(between.max()), int(first[int(between.argmax())])))
    gap_ns, row = max(gaps)
    return gap_ns / 1e9, row


def _between(track: Track, begin_ns: int, end_ns: int) -> Track:
    """The samples within log times."""
    return track.select((track.log_ns >= begin_ns) & (track.log_ns <= end_ns))


def _assemble(stroke: Stroke, samples: StrokeSamples, robot: Robot, origin: Origin) -> Episode:
    assembler = EpisodeAssembler(stroke.label, origin.subject, origin.source, robot)
    joints, ball = samples.joints, samples.ball
    for time_ns, position, velocity in zip(joints.time_ns, joints.values, joints.velocity, strict=True):
        assembler.add_joints(int(time_ns), position, velocity)
    for time_ns, position in zip(ball.time_ns, ball.values, strict=True):
        assembler.add_ball(int(time_ns), position)
    for message in stroke.messages:
        if message.topic == OUTCOME:
            assembler.add_outcome(_read(message, OUTCOME))
    return assembler.assemble()
