"""A stroke's messages as arrays, read once for inspection and learning alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.schemas import deserialise
from msrd_ros.bags.strokes import Stroke
from msrd_ros.contract.joint_states import JointStateTranslator
from msrd_ros.contract.stamps import stamp_to_ns
from msrd_ros.contract.topics import BALL_POSITION, CONTRACT, JOINT_STATES
from msrd_ros.contract.translation import read_ball_position
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.verdict import Finding, Refusal
from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]
Times = NDArray[np.int64]


@dataclass(frozen=True)
class Track:
    """The samples of one topic, in the order in which they were received.

    Attributes
    ----------
    role
        Which topic: the contract's relative name.
    time_ns
        Stamps, shape (n,); times of reception where the messages have no stamps.
    log_ns, received_ns
        Log times of the stroke, and times of reception, shape (n,).
    message
        Numbers of the stroke's messages, shape (n,).
    values
        Joint positions (n, N) in rad, or ball positions (n, 3) in m.
    velocity
        Joint velocities (n, N) in rad/s; of no use for the ball.
    """

    role: str
    time_ns: Times
    log_ns: Times
    received_ns: Times
    message: NDArray[np.intp]
    values: Array
    velocity: Array

    def __len__(self) -> int:
        return len(self.time_ns)

    def rising(self) -> Track:
        """The samples that are newer than all before them: what is learned from."""
        newest = np.maximum.accumulate(self.time_ns)
        return self.select(np.append(self.time_ns[:1] == newest[:1], self.time_ns[1:] > newest[:-1]))

    def select(self, rows: NDArray[np.bool_]) -> Track:
        """The samples of some rows, shape (n,)."""
        return Track(
            self.role,
            self.time_ns[rows],
            self.log_ns[rows],
            self.received_ns[rows],
            self.message[rows],
            self.values[rows],
            self.velocity[rows],
        )


@dataclass
class StrokeSamples:
    """Both tracks of a stroke, and what was noticed while reading them.

    Attributes
    ----------
    joints, ball
        What could be read.
    told
        Whether the driver itself told most of the velocities.
    findings
        What is wrong with single messages.
    notes
        What is no fault, but should be known.
    """

    joints: Track
    ball: Track
    told: bool = True
    findings: list[Finding] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class _Reader:
    """Messages of one topic, deserialised; a fault that many of them share is one finding.

    A message that comes again with the same stamp, as an unanswered tick does, counts once.
    """

    def __init__(
        self, stroke: Stroke, role: str, reason: Refusal, mine: Callable[[Any], bool] = lambda _: True
    ) -> None:
        self._stroke, self._role, self._reason = stroke, role, reason
        self._findings: list[Finding] = []
        self._faults = 0
        self.rows: list[tuple[int, int, Array, Array]] = []
        messages = self._deserialised()
        stamps = [stamp_to_ns(message.header.stamp) for _, message in messages if mine(message)]
        self.stampless = len(stamps) > 1 and not any(stamps)
        data = [stroke.messages[index].data for index, _ in messages]
        self.messages = [
            entry for i, entry in enumerate(messages) if self.stampless or not i or data[i] != data[i - 1]
        ]

    def _deserialised(self) -> list[tuple[int, Any]]:
        messages = []
        for index, message in enumerate(self._stroke.messages):
            if message.topic == self._role:
                try:
                    messages.append((index, deserialise(message.data, CONTRACT[self._role].type_name)))
                except UserError as error:
                    self.fault(index, f"{self._role}: {error}")
        return messages

    def time_ns(self, index: int, message: Any, by_reception: bool) -> int:
        """When a sample was taken."""
        return self._stroke.received_ns[index] if by_reception else stamp_to_ns(message.header.stamp)

    def fault(self, index: int, text: str) -> None:
        """Note what is wrong with a message."""
        if not self._faults:
            self._findings.append(Finding(self._reason, text, index))
        self._faults += 1

    @property
    def findings(self) -> list[Finding]:
        """The first fault, with the number of messages that have one."""
        more = f" ({self._faults} messages are faulty)" if self._faults > 1 else ""
        return [finding._replace(text=f"{finding.text}{more}") for finding in self._findings]

    def track(self, width: int) -> Track:
        """The rows that were read as arrays."""
        index = np.array([row[0] for row in self.rows], dtype=np.intp)
        log_ns = np.array([message.log_time_ns for message in self._stroke.messages], dtype=np.int64)
        received_ns = np.array(self._stroke.received_ns, dtype=np.int64)
        return Track(
            self._role,
            np.array([row[1] for row in self.rows], dtype=np.int64),
            log_ns[index],
            received_ns[index],
            index,
            np.array([row[2] for row in self.rows], dtype=np.float64).reshape(len(self.rows), width),
            np.array([row[3] for row in self.rows], dtype=np.float64).reshape(len(self.rows), width),
        )


def read_samples(stroke: Stroke, robot: Robot) -> StrokeSamples:
    """Read joint states and ball positions of a stroke.

    Where the messages of one of the two have no stamps, the times of reception stand in for those of both.

    Parameters
    ----------
    stroke
        What was recorded.
    robot
        Whose joints, N of them.
    """
    translator = JointStateTranslator(robot, JOINT_STATES)
    joints = _Reader(
        stroke, JOINT_STATES, Refusal.BAD_JOINT_STATES, lambda message: translator.owns(message.name)
    )
    ball = _Reader(stroke, BALL_POSITION, Refusal.BAD_BALL)
    stampless = [role for role, reader in ((JOINT_STATES, joints), (BALL_POSITION, ball)) if reader.stampless]
    for index, message in joints.messages:
        try:
            time_ns = joints.time_ns(index, message, bool(stampless))
            sample = translator.sample(message, time_ns)
        except UserError as error:
            joints.fault(index, str(error))
            continue
        if sample is not None:
            joints.rows.append((index, time_ns, *sample))
    if joints.messages and not joints.rows and not joints.findings:
        names = Counter(tuple(message.name) for _, message in joints.messages)
        index = joints.messages[0][0]
        joints.fault(index, str(translator.missing(names.most_common(1)[0][0])))
    for index, message in ball.messages:
        try:
            position = read_ball_position(message, BALL_POSITION)
        except UserError as error:
            ball.fault(index, str(error))
            continue
        ball.rows.append((index, ball.time_ns(index, message, bool(stampless)), position, np.zeros(3)))
    notes = translator.remarks()
    if stampless:
        notes.append(f"{' and '.join(stampless)} without stamps; times of reception stand in for them")
    return StrokeSamples(
        joints.track(robot.joint_count),
        ball.track(3),
        2 * translator.derived < len(joints.rows),
        [*joints.findings, *ball.findings],
        notes,
    )
