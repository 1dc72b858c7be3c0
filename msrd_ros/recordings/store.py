"""Judging a stroke and keeping it as a bag: what the recorder does with each ball."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from msrd_ros.bags.metadata import FORMAT_KEY, NOTE_KEY, STROKE_FORMAT
from msrd_ros.bags.schemas import deserialise
from msrd_ros.bags.static_transforms import static_transforms_from_urdf
from msrd_ros.bags.strokes import Stroke
from msrd_ros.bags.writer import keep_stroke
from msrd_ros.contract.columns import CONTRACT_KEY, stroke_contract
from msrd_ros.contract.labels import say_label
from msrd_ros.contract.topics import CONTRACT, ROBOT_DESCRIPTION, TF_STATIC, BagMessage, BagTopic
from msrd_ros.recordings.episodes import ROBOT_KEY
from msrd_ros.recordings.inspection import inspect, label_joint_states
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.verdict import Refusal, Verdict
from msrd_ros.robots.robot import Robot

_NO_LABEL = Verdict(
    Refusal.NO_LABEL,
    "no strategy was set; publish its label on strategy, or keep such strokes with unlabelled:=true",
)


@dataclass(frozen=True)
class StoreResult:
    """What became of a stroke.

    Attributes
    ----------
    stroke
        The stroke.
    subject
        Who showed it.
    verdict
        Whether it may serve as a demonstration, and why not.
    path
        Its bag; None if none was written.
    """

    stroke: Stroke
    subject: str
    verdict: Verdict
    path: Path | None = None

    @property
    def name(self) -> str:
        """Which stroke, for a person."""
        return f"{say_label(self.stroke.label)} of {self.subject}, ball {self.stroke.ball_id or '?'}"


class StrokeStore:
    """Writes accepted strokes below one folder.

    Parameters
    ----------
    directory
        The folder of all subjects.
    robot
        The arm that is led.
    limits
        What is accepted.
    written_by
        Name and version of the program, for the metadata.
    minimum_free_bytes
        With less room on the disk nothing is written.
    """

    def __init__(
        self,
        directory: Path,
        robot: Robot,
        limits: InspectionLimits,
        written_by: str,
        minimum_free_bytes: int = 0,
    ) -> None:
        self._robot = robot
        self._directory = directory
        self._limits = limits
        self._written_by = written_by
        self._minimum_free_bytes = minimum_free_bytes

    @property
    def free_bytes(self) -> int:
        """Room that is left on the disk."""
        return shutil.disk_usage(self._directory).free

    def keep(
        self,
        stroke: Stroke,
        subject: str,
        topics: Mapping[str, BagTopic],
        latched: Mapping[str, Sequence[bytes]],
        keep_all: bool = False,
        note: str = "",
        unlabelled: bool = False,
    ) -> StoreResult:
        """Judge a stroke, and write it if it is accepted.

        Parameters
        ----------
        subject
            Who showed it; becomes part of the path.
        topics
            Full topic by the relative name that the stroke's messages carry.
        latched
            Latched messages in effect (`robot_description`, ``/tf_static``), by relative name.
        keep_all
            Write refused strokes as well, marked as such.
        note
            What is said of it in its metadata; nothing if empty.
        unlabelled
            Write strokes without a label as well; else they are refused, also with `keep_all`.
        """
        verdict = inspect(stroke, self._robot, self._limits)
        if stroke.label is None and not unlabelled:
            return StoreResult(stroke, subject, verdict if verdict.reason else _NO_LABEL)
        if not (verdict.accepted or keep_all):
            return StoreResult(stroke, subject, verdict)
        free = self.free_bytes
        if free < self._minimum_free_bytes:
            detail = f"only {free / 1e6:.0f} MB are left on the disk of {self._directory}; make room"
            return StoreResult(stroke, subject, Verdict(Refusal.DISK_FULL, detail))
        messages = [*_latched_messages(latched, stroke.messages[0].log_time_ns), *label_joint_states(stroke)]
        used = dict.fromkeys(message.topic for message in messages)
        custom_data = {
            "outcome": stroke.outcome or "",
            "version": self._written_by,
            FORMAT_KEY: str(STROKE_FORMAT),
            ROBOT_KEY: self._robot.identity,
            CONTRACT_KEY: stroke_contract(self._robot).to_json(),
            "ball_id": stroke.ball_id,
            "kept": "true" if verdict.accepted else "false",
            "reason": verdict.reason,
            **self._limits.settings(),
            **({NOTE_KEY: note} if note else {}),
        }
        try:
            path = keep_stroke(
                self._directory,
                subject,
                stroke.label,
                [topics[role] for role in used],
                [message._replace(topic=topics[message.topic].name) for message in messages],
                custom_data,
            )
        except OSError as error:
            detail = f"{self._directory} cannot be written ({error.strerror or error}); mend that and repeat"
            return StoreResult(stroke, subject, Verdict(Refusal.WRITE_FAILED, detail))
        return StoreResult(stroke, subject, verdict, path)


def _latched_messages(latched: Mapping[str, Sequence[bytes]], time_ns: int) -> list[BagMessage]:
    """Latched messages at the bag's beginning; the robot's fixed frames also where nobody published them."""
    found = {role: list(data) for role, data in latched.items() if data}
    if ROBOT_DESCRIPTION in found and TF_STATIC not in found:
        urdf = deserialise(found[ROBOT_DESCRIPTION][-1], CONTRACT[ROBOT_DESCRIPTION].type_name).data
        transforms = static_transforms_from_urdf(urdf, time_ns)
        if transforms is not None:
            found[TF_STATIC] = [transforms]
    return [BagMessage(role, data, time_ns, time_ns) for role, items in found.items() for data in items]
