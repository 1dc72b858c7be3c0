"""A data set's rows as messages: strokes of whoever wrote it, by a mapping file that names its columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.schemas import HEADER_TYPE, serialise, typestore
from msrd_ros.bags.strokes import Stroke, whole_stroke
from msrd_ros.contract.columns import POINT, POSITION, SPEED_FRACTION, VELOCITY, Columns, DataContract
from msrd_ros.contract.labels import UNLABELLED, StrategyLabel, read_label
from msrd_ros.contract.stamps import NANOSECONDS
from msrd_ros.contract.topics import BALL_POSITION, CONTRACT, JOINT_STATES, STRATEGY, BagMessage
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.table import Table, TableEpisode
from msrd_ros.robots.robot import Robot

WORLD = "world"
_BEGIN_NS = NANOSECONDS
"""Stamp of the first row where the data set has none; one of zero would say that there are no stamps."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MadeStroke:
    """A stroke that was made of rows.

    Attributes
    ----------
    number
        Of the data set's episode.
    subject
        Who showed it.
    stroke
        As a recorder would have cut it.
    """

    number: int
    subject: str
    stroke: Stroke


def make_strokes(table: Table, contract: DataContract, robot: Robot, where: str) -> Iterator[MadeStroke]:
    """Strokes from the rows of a data set.

    Columns whose `align` is `next` or `difference` follow from others and are passed over.

    Parameters
    ----------
    table
        The data set.
    contract
        What its columns are.
    robot
        Whose joints.
    where
        The contract's file, to blame.

    Raises
    ------
    UserError
        If a feature or entry is not there, joints are missing, or a task is no label; names it.
    """
    samples = [columns for columns in contract.columns if columns.align.is_sample]
    places = {columns: _places(columns, table, where) for columns in samples}
    _require_fields(samples, robot, where)
    rate_hz = _rate_hz(table, contract, where)
    for episode in table.episodes(list(dict.fromkeys(columns.feature for columns in samples))):
        label = _label(episode, contract, f"{table.where}: episode {episode.number}", where)
        subject = contract.subject or str(episode.facts.get("subject") or "")
        if not subject:
            raise UserError(f"{where}: lacks subject, and the data set does not say who showed its strokes")
        values = {
            (columns.topic, columns.field): _values(episode, columns, places[columns], robot, table.where)
            for columns in samples
        }
        messages = _messages(values, robot, label, _stamps(episode, values, rate_hz))
        yield MadeStroke(episode.number, subject, whole_stroke(messages, label, lambda _: True))


def _places(columns: Columns, table: Table, where: str) -> list[int]:
    """Where the entries stand in their feature."""
    names, width = table.entry_names(columns.feature), table.width(columns.feature)
    found = []
    for entry in columns.entries:
        if isinstance(entry, str) and entry not in (names or ()):
            known = ", ".join(names) if names else f"none; use numbers from 0 to {width - 1}"
            raise UserError(
                f"{where}: {columns.feature} has no entry {entry!r}; its entries' names are {known}"
            )
        place = entry if isinstance(entry, int) else (names or []).index(entry)
        if place >= width:
            raise UserError(f"{where}: {columns.feature} has no entry {place}; it has {width}, from 0")
        found.append(place)
    return found


def _require_fields(samples: list[Columns], robot: Robot, where: str) -> None:
    """A stroke is told by all joints' positions and the ball's, each once."""
    fields = [(columns.topic, columns.field) for columns in samples]
    for place in ((JOINT_STATES, POSITION), (BALL_POSITION, POINT)):
        if place not in fields:
            raise UserError(
                f"{where}: says of no column that it is {place[1]} of {place[0]}, and a bag needs it; a data "
                "set without a ball can be learned from with msrd_ros.learning.demonstrations_from_lerobot"
            )
    for columns in samples:
        if fields.count((columns.topic, columns.field)) > 1:
            raise UserError(f"{where}: {columns.field} of {columns.topic} is told twice; leave one out")
        if columns.topic == JOINT_STATES and sorted(columns.joints) != sorted(robot.joint_names):
            raise UserError(
                f"{where}: {columns.feature} tells joints {', '.join(columns.joints)}, and {robot.name} has "
                f"{', '.join(robot.joint_names)}; say with joints which entry is which, or another robot"
            )


def _rate_hz(table: Table, contract: DataContract, where: str) -> float:
    if table.rate_hz is None and contract.rate_hz is None:
        raise UserError(
            f"{where}: lacks rate_hz, and {table.where} does not say how many rows a second it has"
        )
    if None not in (table.rate_hz, contract.rate_hz) and table.rate_hz != contract.rate_hz:
        raise UserError(
            f"{where}: rate_hz is {contract.rate_hz:g}, and {table.where} has {table.rate_hz:g} rows a "
            "second; leave it out"
        )
    return float(table.rate_hz or contract.rate_hz or 0.0)


def _label(episode: TableEpisode, contract: DataContract, where: str, mapping: str) -> StrategyLabel | None:
    if contract.labels and episode.task not in contract.labels:
        raise UserError(
            f"{mapping}: labels lacks the task {episode.task!r} ({where}); say {UNLABELLED} if it has none"
        )
    try:
        return read_label(contract.labels.get(episode.task, episode.task), where)
    except UserError as error:
        raise UserError(f"{error}; or say labels: {{{episode.task!r}: LABEL}} in {mapping}") from None


def _values(episode: TableEpisode, columns: Columns, places: list[int], robot: Robot, where: str) -> Array:
    """Values of a field in SI units, joints in the arm's order, shape (T, N) or (T, 3)."""
    values = episode.rows[columns.feature].astype(np.float64)[:, places] * columns.factor
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        step, entry = bad[0]
        raise UserError(
            f"{where}: episode {episode.number}, row {step}: {columns.feature} {columns.entries[entry]} is "
            f"{values[step, entry]}; mend the data set or leave the episode out"
        )
    if columns.topic == JOINT_STATES:
        values = values[:, [columns.joints.index(joint) for joint in robot.joint_names]]
    return values * robot.limits.speed_rad_s if columns.unit == SPEED_FRACTION else values


def _stamps(
    episode: TableEpisode, values: Mapping[tuple[str, str], Array], rate_hz: float
) -> NDArray[np.int64]:
    told = episode.facts.get("start_ns")
    start_ns = int(told) if isinstance(told, int | np.integer) and told > 0 else _BEGIN_NS
    count = min(map(len, values.values()))
    since_ns = np.round(np.arange(count) / rate_hz * NANOSECONDS).astype(np.int64)
    return np.asarray(start_ns + since_ns)


def _messages(
    values: Mapping[tuple[str, str], Array],
    robot: Robot,
    label: StrategyLabel | None,
    stamps: NDArray[np.int64],
) -> list[BagMessage]:
    """One strategy, and of every row the joints' state and the ball, on relative names."""
    first = int(stamps[0])
    messages = [_message(STRATEGY, first, _header(first, str(label or "")))]
    names, empty = list(robot.joint_names), np.zeros(0)
    velocities = values.get((JOINT_STATES, VELOCITY))
    for row, stamp in enumerate(map(int, stamps)):
        state = _make(
            CONTRACT[JOINT_STATES].type_name,
            _header(stamp, ""),
            names,
            np.ascontiguousarray(values[JOINT_STATES, POSITION][row]),
            empty if velocities is None else np.ascontiguousarray(velocities[row]),
            empty,
        )
        point = _make("geometry_msgs/msg/Point", *map(float, values[BALL_POSITION, POINT][row]))
        seen = _make(CONTRACT[BALL_POSITION].type_name, _header(stamp, WORLD), point)
        messages += [_message(JOINT_STATES, stamp, state), _message(BALL_POSITION, stamp, seen)]
    return messages


def _make(type_name: str, *fields: Any) -> Any:
    return typestore().types[type_name](*fields)


def _header(time_ns: int, frame_id: str) -> Any:
    return _make(HEADER_TYPE, _make("builtin_interfaces/msg/Time", *divmod(time_ns, NANOSECONDS)), frame_id)


def _message(role: str, time_ns: int, content: Any) -> BagMessage:
    return BagMessage(role, serialise(content, CONTRACT[role].type_name), time_ns, time_ns)
