"""Which field of which topic stands in which column, said as data.

`stroke_contract` says it of what `contract.translation` makes of messages; bags and data sets carry it. A
data set of others is read by a mapping file that says the same of its columns.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import yaml

from msrd_ros.contract.episode import BALL_NAMES, CONTROL_PERIOD_S, action_names
from msrd_ros.contract.topics import BALL_POSITION, JOINT_STATES
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format
from msrd_ros.robots.robot import Robot

CONTRACT_FORMAT = 1
CONTRACT_KEY = "contract"
"""In a bag's `custom_data`: the contract as JSON."""

POSITION, VELOCITY, POINT = "position", "velocity", "point"

STATE, ENVIRONMENT_STATE, ACTION = "observation.state", "observation.environment_state", "action"
JOINT_VELOCITY = "joint_velocity"
"""The features of a data set. LeRobot's policies see those called `observation...` or `action` alone."""

SPEED_FRACTION = "speed_fraction"
"""Unit of a joint's velocity as a share of its speed limit."""

_FACTORS: Mapping[tuple[str, str], Mapping[str, float]] = {
    (JOINT_STATES, POSITION): {"rad": 1.0, "deg": math.pi / 180.0},
    (JOINT_STATES, VELOCITY): {"rad/s": 1.0, "deg/s": math.pi / 180.0, SPEED_FRACTION: 1.0},
    (BALL_POSITION, POINT): {"m": 1.0, "mm": 1e-3, "m/s": 1.0},
}
"""By topic and field: the units that are understood, and what they are in SI units."""


class Align(StrEnum):
    """How a column's value at a tick is taken from messages, by the stamps in their headers."""

    LINEAR = "linear"
    """Interpolated between the messages before and after the tick."""
    HOLD = "hold"
    """Of the newest message up to the tick."""
    DIFFERENCE = "difference"
    """Difference of what `HOLD` takes at this tick and at the one before, over the messages' stamps."""
    NEXT = "next"
    """Interpolated at the tick after this one: what the row's command led to."""

    @property
    def is_sample(self) -> bool:
        """Whether the column tells a message's own value at the tick; others follow from such."""
        return self in (Align.LINEAR, Align.HOLD)


@dataclass(frozen=True)
class Columns:
    """Entries of one feature that come from one field of a topic.

    Attributes
    ----------
    feature
        Of the data set.
    entries
        Which of its entries, in the order of `joints`, or x, y, z: by their names, or by numbers from 0.
    topic, field
        Relative name of the contract, and the message's field.
    unit
        Of the entries.
    align
        How values are taken at a tick.
    joints
        Of `joint_states`: whose values the entries are; empty for the ball.
    """

    feature: str
    entries: tuple[str | int, ...]
    topic: str
    field: str
    unit: str
    align: Align
    joints: tuple[str, ...] = ()

    @property
    def factor(self) -> float:
        """What a value is multiplied with to be in SI units; shares of limits stay shares."""
        return _FACTORS[self.topic, self.field][self.unit]

    def to_dict(self) -> dict[str, Any]:
        """As it is written."""
        return {
            "feature": self.feature,
            "entries": list(self.entries),
            "topic": self.topic,
            "field": self.field,
            "unit": self.unit,
            "align": str(self.align),
            **({"joints": list(self.joints)} if self.joints else {}),
        }

    @classmethod
    def parse(cls, content: object, where: str) -> Columns:
        """Read an item of the list `columns`; `align` may be left out, and `joints` where entries are joints.

        Raises
        ------
        UserError
            If it is not understood; names the key and what to write.
        """
        told = _keys(content, ("feature", "entries", "topic", "field", "unit"), ("align", "joints"), where)
        feature, place = (
            _text(told, "feature", where),
            (_text(told, "topic", where), _text(told, "field", where)),
        )
        where = f"{where} ({feature})"
        if place not in _FACTORS:
            known = ", ".join(f"{topic}: {name}" for topic, name in _FACTORS)
            raise UserError(f"{where}: {place[0]}: {place[1]} cannot be filled from columns; use {known}")
        unit = _text(told, "unit", where)
        if unit not in _FACTORS[place]:
            raise UserError(f"{where}: unit {unit!r} is unknown; use {', '.join(_FACTORS[place])}")
        entries = _entries(told["entries"], where)
        usual = Align.LINEAR if place[0] == JOINT_STATES else Align.HOLD
        align = str(told.get("align", usual))
        if align not in tuple(Align):
            raise UserError(f"{where}: align {align!r} is unknown; use {', '.join(Align)}, or leave it out")
        if place == (BALL_POSITION, POINT) and (unit == "m/s") != (align == Align.DIFFERENCE):
            other = "align difference" if unit == "m/s" else "another align"
            raise UserError(f"{where}: unit {unit} goes with {other}")
        joints = tuple(told.get("joints", entries if place[0] == JOINT_STATES else ()))
        if not all(isinstance(joint, str) for joint in joints):
            raise UserError(f"{where}: say with joints which joints entries {list(entries)} are, by name")
        if place[0] == JOINT_STATES and len(entries) != len(joints):
            raise UserError(f"{where}: {len(entries)} entries; give one for each of {len(joints)} joints")
        if place[0] == BALL_POSITION and (len(entries) != 3 or joints):
            raise UserError(f"{where}: {len(entries)} entries; give three, x, y and z, and no joints")
        return cls(feature, entries, *place, unit, Align(align), joints)


@dataclass(frozen=True)
class DataContract:
    """What columns of a data set are, and how they come from topics or go back to them.

    Attributes
    ----------
    robot
        Whose joints: a name, a folder, or `Robot.identity`.
    columns
        Of all features that come from topics.
    rate_hz
        Rows a second; None where the data set says it itself.
    labels
        Strategy by task text, for data sets whose tasks are no labels.
    subject
        Who showed the strokes, for data sets that do not say it.
    """

    robot: str
    columns: tuple[Columns, ...]
    rate_hz: float | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    subject: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As it is written."""
        return {
            FORMAT_KEY: CONTRACT_FORMAT,
            "robot": self.robot,
            **({"rate_hz": self.rate_hz} if self.rate_hz is not None else {}),
            "columns": [columns.to_dict() for columns in self.columns],
            **({"labels": dict(self.labels)} if self.labels else {}),
            **({"subject": self.subject} if self.subject else {}),
        }

    def to_json(self) -> str:
        """One line, for a bag's `custom_data`."""
        return json.dumps(self.to_dict(), separators=(",", ":"))

    def to_yaml(self) -> str:
        """As a mapping file."""
        text: str = yaml.safe_dump(self.to_dict(), sort_keys=False, width=110, default_flow_style=None)
        return text

    @classmethod
    def read(cls, path: Path) -> DataContract:
        """Read a mapping file.

        Raises
        ------
        UserError
            If it cannot be read or says something that is not understood; names file and key.
        """
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            reason = (str(error).splitlines() or [""])[0]
            raise UserError(f"mapping {path}: not readable ({reason}); mend it or name another") from None
        return cls.parse(content, f"mapping {path}")

    @classmethod
    def parse(cls, content: object, where: str) -> DataContract:
        """Read what `to_dict` writes.

        Raises
        ------
        UserError
            If it says something that is not understood; names the key and what to write.
        """
        told = _keys(content, ("robot", "columns"), (FORMAT_KEY, "rate_hz", "labels", "subject"), where)
        require_format(told.get(FORMAT_KEY, FIRST_FORMAT), CONTRACT_FORMAT, where)
        rate_hz = told.get("rate_hz")
        if rate_hz is not None and not (isinstance(rate_hz, int | float) and 0.0 < rate_hz < math.inf):
            raise UserError(f"{where}: rate_hz is {rate_hz!r}; write rows a second as a number")
        columns = told["columns"]
        if not isinstance(columns, list) or not columns:
            raise UserError(f"{where}: columns is no list; write one item for every field of a topic")
        labels = told.get("labels", {})
        if not isinstance(labels, dict) or not all(
            isinstance(item, str) for item in (*labels, *labels.values())
        ):
            raise UserError(f"{where}: labels is no map; write TASK: LABEL for every task of the data set")
        found = tuple(Columns.parse(item, f"{where}: columns {n}") for n, item in enumerate(columns))
        subject = _text({"subject": told.get("subject", "")}, "subject", where)
        return cls(
            _text(told, "robot", where), found, None if rate_hz is None else float(rate_hz), labels, subject
        )


def stroke_contract(robot: Robot) -> DataContract:
    """What `contract.translation` makes of an arm's messages, column by column."""
    joints = robot.joint_names
    return DataContract(
        robot.identity,
        (
            Columns(STATE, joints, JOINT_STATES, POSITION, "rad", Align.LINEAR, joints),
            Columns(ENVIRONMENT_STATE, BALL_NAMES[:3], BALL_POSITION, POINT, "m", Align.HOLD),
            Columns(ENVIRONMENT_STATE, BALL_NAMES[3:], BALL_POSITION, POINT, "m/s", Align.DIFFERENCE),
            Columns(ACTION, action_names(robot), JOINT_STATES, VELOCITY, SPEED_FRACTION, Align.NEXT, joints),
            Columns(JOINT_VELOCITY, joints, JOINT_STATES, VELOCITY, "rad/s", Align.LINEAR, joints),
        ),
        1.0 / CONTROL_PERIOD_S,
    )


def _keys(content: object, needed: Sequence[str], optional: Sequence[str], where: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise UserError(f"{where}: is no map; write {', '.join(needed)}")
    for key in content:
        if key not in (*needed, *optional):
            raise UserError(f"{where}: key {key!r} is unknown; use {', '.join((*needed, *optional))}")
    for key in needed:
        if key not in content:
            raise UserError(f"{where}: lacks {key}")
    return content


def _text(told: Mapping[str, Any], key: str, where: str) -> str:
    value = told[key]
    if not isinstance(value, str) or (not value and key != "subject"):
        raise UserError(f"{where}: {key} is {value!r}; write text")
    return value


def _entries(content: object, where: str) -> tuple[str | int, ...]:
    if not isinstance(content, list) or not content:
        raise UserError(
            f"{where}: entries is no list; write names of the feature's entries, or numbers from 0"
        )
    for entry in content:
        if not isinstance(entry, str) and (
            not isinstance(entry, int) or isinstance(entry, bool) or entry < 0
        ):
            raise UserError(f"{where}: entry {entry!r} is neither a name nor a number from 0")
    if len(set(content)) < len(content):
        raise UserError(f"{where}: an entry is named twice; each tells one value")
    return tuple(content)
