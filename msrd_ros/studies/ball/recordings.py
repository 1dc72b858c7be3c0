"""Reading recorded balls: events of matches, and flights with measured spin.

A folder of recordings holds one of these files, or both:

- ``match_events.csv``: one row for each event of a rally, columns `COLUMNS` in any order. ``rally_id`` is
  ``<game>/<rally>/event<number>``, ``type`` is ``shot_``, ``bounce_`` and ``p1`` or ``p2``, or ``net``;
  ``timestamp`` in s; position (m), velocity (m/s) and spin (rad/s) right after the event are each three
  numbers in brackets. Origin at the centre of the table's surface, z up.
- ``flights.zip``, or a folder ``flights``: ``index.csv`` with the columns `INDEX_COLUMNS` (spin in rad/s),
  and for each of its rows ``<traj_file with three digits>.csv`` of rows ``t;x;y;z`` in s and m.
"""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError

Array = NDArray[np.float64]

EVENTS_FILE = "match_events.csv"
FLIGHTS = "flights"
COLUMNS = ("player_id", "rally_id", "type", "timestamp", "ball_pos", "ball_vel_out", "ball_spin_out")
INDEX_COLUMNS = ("traj_file", "x_spin", "y_spin", "z_spin")
KINDS = ("shot_p1", "shot_p2", "bounce_p1", "bounce_p2", "net")

WHERE_TO_GET = (
    "events: `data/match_data.csv` of github.com/SonyResearch/ace_public, saved as match_events.csv; "
    "flights: `data/trajectories/trajectories.zip` of github.com/cogsys-tuebingen/spindoe, unpacked into a "
    "folder flights or packed as flights.zip"
)

_RALLY = re.compile(r"^(?P<rally>.+)/event(?P<number>\d+)$")


@dataclass(frozen=True)
class Events:
    """Events of N balls in the order of the file; a rally's follow each other.

    Attributes
    ----------
    player, rally, kind
        Shape (N,) each; `rally` tells games of different players apart.
    time_s
        Shape (N,).
    balls
        Position (m), velocity (m/s) and spin (rad/s) after the event, shape (N, 9); NaN where nothing was
        measured.
    """

    player: NDArray[np.str_]
    rally: NDArray[np.str_]
    kind: NDArray[np.str_]
    time_s: Array
    balls: Array


@dataclass(frozen=True)
class SpinFlight:
    """A recorded flight: times in s (T,), positions in m (T, 3), spin in rad/s (3,) in the camera's frame."""

    name: str
    times_s: Array
    positions: Array
    spin: Array


def read_events(folder: Path) -> Events | None:
    """Events of a folder of recordings; None if it has none.

    Raises
    ------
    UserError
        If the file is not of the form above; names file, row and column.
    """
    path = folder / EVENTS_FILE
    if not path.is_file():
        return None
    players, rallies, kinds, times, balls, numbers = [], [], [], [], [], []
    for place, row in _rows(path.name, _text(path.name, path.read_bytes), COLUMNS):
        found = _RALLY.match(row["rally_id"])
        if found is None:
            raise UserError(f"{place}: rally_id is {row['rally_id']!r}; not <game>/<rally>/event<number>")
        if row["type"] not in KINDS:
            raise UserError(f"{place}: type is {row['type']!r}; expected one of {', '.join(KINDS)}")
        players.append(row["player_id"])
        rallies.append(f"{row['player_id']} {found['rally']}")
        numbers.append(int(found["number"]))
        kinds.append(row["type"])
        times.append(_number(place, "timestamp", row["timestamp"]))
        balls.append(np.concatenate([_vector(place, name, row[name]) for name in COLUMNS[-3:]]))
    if not players:
        raise UserError(f"{path.name}: no events in it")
    order = _follow_each_other(path.name, rallies, numbers, times)
    return Events(
        np.array(players)[order],
        np.array(rallies)[order],
        np.array(kinds)[order],
        np.array(times)[order],
        np.array(balls)[order],
    )


def read_flights(folder: Path) -> list[SpinFlight] | None:
    """Flights of a folder of recordings; None if it has none.

    Raises
    ------
    UserError
        If a file is missing or not of the form above; names it.
    """
    packed, unpacked = folder / f"{FLIGHTS}.zip", folder / FLIGHTS
    if packed.is_file():
        try:
            with zipfile.ZipFile(packed) as archive:
                inside = {Path(name).name: name for name in archive.namelist() if name.endswith(".csv")}
                return _read_flights(packed.name, lambda name: archive.read(inside[name]))
        except zipfile.BadZipFile:
            raise UserError(f"{packed.name}: not a zip file") from None
    if unpacked.is_dir():
        return _read_flights(unpacked.name, lambda name: (unpacked / name).read_bytes())
    return None


def _read_flights(source: str, read: Callable[[str], bytes]) -> list[SpinFlight]:
    flights = []
    index = _text(f"{source}/index.csv", lambda: read("index.csv"))
    for place, row in _rows(f"{source}/index.csv", index, INDEX_COLUMNS):
        number = _number(place, "traj_file", row["traj_file"])
        name = f"{round(number):03d}.csv"
        lines = _text(f"{source}/{name}", lambda name=name: read(name))  # type: ignore[misc]
        spin = np.array([_number(place, axis, row[axis]) for axis in INDEX_COLUMNS[1:]])
        samples = _samples(f"{source}/{name}", lines)
        flights.append(SpinFlight(name, samples[:, 0], samples[:, 1:], spin))
    if not flights:
        raise UserError(f"{source}/index.csv: no flights in it")
    return flights


def _samples(name: str, text: str) -> Array:
    """Rows ``t;x;y;z`` as (T, 4)."""
    try:
        samples = np.loadtxt(io.StringIO(text), delimiter=";", ndmin=2)
    except ValueError as error:
        raise UserError(f"{name}: expected rows t;x;y;z ({error})") from None
    if samples.ndim != 2 or samples.shape[1] != 4 or len(samples) < 2 or not np.isfinite(samples).all():
        raise UserError(f"{name}: expected at least two rows t;x;y;z of finite numbers")
    if (np.diff(samples[:, 0]) < 0.0).any():
        raise UserError(f"{name}: its times fall")
    # Times are rounded to a millisecond: two cameras may have seen a ball within one.
    return np.asarray(samples[np.diff(samples[:, 0], prepend=-np.inf) > 0.0], dtype=np.float64)


def _text(name: str, read: Callable[[], bytes]) -> str:
    try:
        return read().decode()
    except (OSError, KeyError):
        raise UserError(f"{name}: missing or not readable") from None
    except UnicodeDecodeError:
        raise UserError(f"{name}: not a text file") from None


def _rows(name: str, text: str, columns: tuple[str, ...]) -> list[tuple[str, dict[str, str]]]:
    """Rows of a table by column, each with its place for messages."""
    reader = csv.DictReader(io.StringIO(text))
    missing = [column for column in columns if column not in (reader.fieldnames or ())]
    if missing:
        raise UserError(f"{name}: without column {', '.join(missing)}; its form is in `docs/studies.md`")
    rows = []
    for row in reader:
        place = f"{name}, line {reader.line_num}"
        if any(row[column] is None for column in columns):
            raise UserError(f"{place}: too short")
        rows.append((place, row))
    return rows


def _number(place: str, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise UserError(f"{place}: {column} is {text!r}; expected a number")
    return value


def _vector(place: str, column: str, text: str) -> Array:
    """Three numbers in brackets; nothing at all or NaN is NaN: not measured."""
    words = text.strip().removeprefix("[").removesuffix("]").replace(",", " ").split()
    if not words:
        return np.full(3, np.nan)
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.empty(0)
    if values.shape != (3,) or np.isinf(values).any():
        raise UserError(f"{place}: {column} is {text!r}; expected three numbers in brackets")
    return values


def _follow_each_other(name: str, rallies: list[str], numbers: list[int], times: list[float]) -> list[int]:
    """Places of the events by rally, in the order of their numbers; their times must rise."""
    first_seen = {rally: place for place, rally in reversed(list(enumerate(rallies)))}
    order = sorted(range(len(rallies)), key=lambda place: (first_seen[rallies[place]], numbers[place]))
    for before, after in pairwise(order):
        if rallies[before] != rallies[after]:
            continue
        if numbers[before] == numbers[after]:
            raise UserError(f"{name}: {rallies[after]} has two events {numbers[after]}")
        if times[after] < times[before]:
            raise UserError(
                f"{name}: event {numbers[after]} of {rallies[after]} is {times[after]} s, before the last"
            )
    return order
