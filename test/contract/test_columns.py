"""The contract says what the translation does; a mapping file that is not understood is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edited_bags import shipped
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.columns import Align, Columns, DataContract, stroke_contract
from msrd_ros.contract.stamps import NANOSECONDS, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.exchange.stroke_set import state_rows
from sawyer import ROBOT

CONTRACT = stroke_contract(ROBOT)
ITEM = {"feature": "f", "entries": [0, 1, 2], "topic": "ball/position", "field": "point", "unit": "m"}
JOINTS = {**ITEM, "topic": "joint_states", "field": "position", "unit": "rad", "entries": ["a", "b"]}


def aligned(
    columns: Columns, ticks: np.ndarray[Any, np.dtype[np.int64]]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values at ticks, from a bag's messages by the words of the contract alone."""
    entries = [entry.message for entry in Bag(shipped()).entries() if entry.topic == columns.topic]
    stamps = np.array([stamp_to_ns(message.header.stamp) for message in entries])
    if columns.topic == "joint_states":
        order = [entries[0].name.index(joint) for joint in columns.joints]
        values = np.array([getattr(message, columns.field)[order] for message in entries])
    else:
        values = np.array([[getattr(message.point, axis) for axis in "xyz"] for message in entries])
    if columns.align in (Align.LINEAR, Align.NEXT):
        at = ticks + (NANOSECONDS / (CONTRACT.rate_hz or 0.0) if columns.align is Align.NEXT else 0)
        return np.stack([np.interp(at, stamps, column) for column in values.T], axis=1)
    newest, before = (
        np.searchsorted(stamps, at, side="right") - 1
        for at in (ticks, ticks - round(NANOSECONDS / (CONTRACT.rate_hz or 0.0)))
    )
    if columns.align is Align.HOLD:
        return np.asarray(values[newest])
    since_s = (stamps[newest] - stamps[before]) / NANOSECONDS
    return np.asarray((values[newest] - values[before]) / since_s[:, None])


def test_the_contract_says_what_the_translation_does() -> None:
    (episode,) = read_episodes(Bag(shipped()))
    rows = state_rows(episode)
    assert list(dict.fromkeys(columns.feature for columns in CONTRACT.columns)) == list(rows)
    assert episode.start_ns is not None
    # The first and the last row have no neighbour to be told by.
    ticks = episode.start_ns + np.arange(2, 60) * round(NANOSECONDS / (CONTRACT.rate_hz or 0.0))
    filled = dict.fromkeys(rows, 0)
    for columns in CONTRACT.columns:
        begin = filled[columns.feature]
        filled[columns.feature] += len(columns.entries)
        expected = aligned(columns, ticks)
        if columns.unit == "speed_fraction":
            expected = np.clip(expected / ROBOT.limits.speed_rad_s, -1.0, 1.0)
        found = rows[columns.feature][2:60, begin : begin + len(columns.entries)]
        np.testing.assert_allclose(found, expected, atol=1e-9, err_msg=f"{columns.feature} {columns.align}")
    assert filled == {name: values.shape[1] for name, values in rows.items()}


def test_what_is_written_is_read(tmp_path: Path) -> None:
    file = tmp_path / "mapping.yaml"
    file.write_text(CONTRACT.to_yaml(), encoding="utf-8")
    assert DataContract.read(file) == CONTRACT
    assert DataContract.parse(json.loads(CONTRACT.to_json()), "bag") == CONTRACT


def test_align_and_joints_may_be_left_out() -> None:
    ball, joints = Columns.parse(ITEM, "m"), Columns.parse(JOINTS, "m")
    assert (ball.align, ball.joints) == (Align.HOLD, ())
    assert (joints.align, joints.joints) == (Align.LINEAR, ("a", "b"))


@pytest.mark.parametrize(
    ("item", "blame"),
    [
        ([], "is no map; write feature"),
        ({**ITEM, "units": "m"}, "key 'units' is unknown"),
        ({key: value for key, value in ITEM.items() if key != "unit"}, "lacks unit"),
        ({**ITEM, "feature": ""}, "feature is ''; write text"),
        ({**ITEM, "topic": "feed"}, "feed: point cannot be filled from columns; use joint_states: position"),
        ({**ITEM, "unit": "inch"}, "unit 'inch' is unknown; use m, mm"),
        ({**ITEM, "unit": "m/s"}, "unit m/s goes with align difference"),
        ({**ITEM, "align": "difference"}, "unit m goes with another align"),
        ({**ITEM, "align": "nearest"}, "align 'nearest' is unknown; use linear, hold"),
        ({**ITEM, "entries": [0, 1]}, "2 entries; give three, x, y and z"),
        ({**ITEM, "entries": [0, 1, 1]}, "an entry is named twice"),
        ({**ITEM, "entries": [0, 1, -1]}, "entry -1 is neither a name nor a number from 0"),
        ({**ITEM, "entries": []}, "entries is no list"),
        ({**ITEM, "joints": ["a", "b", "c"]}, "give three, x, y and z, and no joints"),
        ({**JOINTS, "entries": [0, 1]}, "say with joints which joints entries"),
        ({**JOINTS, "joints": ["a"]}, "2 entries; give one for each of 1 joint"),
    ],
)
def test_columns_that_are_not_understood_are_refused(item: object, blame: str) -> None:
    with pytest.raises(UserError, match=blame):
        Columns.parse(item, "m")


@pytest.mark.parametrize(
    ("change", "blame"),
    [
        ({"format": 2}, "is of format 2, which a newer"),
        ({"rate_hz": 0}, "rate_hz is 0; write rows a second"),
        ({"rate_hz": "50"}, "rate_hz is '50'"),
        ({"columns": []}, "columns is no list"),
        ({"columns": [{**ITEM, "unit": "yd"}]}, "m: columns 0 .f.: unit 'yd'"),
        ({"labels": ["a"]}, "labels is no map"),
        ({"subject": 3}, "subject is 3; write text"),
        ({"robots": "a"}, "key 'robots' is unknown"),
    ],
)
def test_mappings_that_are_not_understood_are_refused(change: dict[str, object], blame: str) -> None:
    with pytest.raises(UserError, match=blame):
        DataContract.parse({"robot": "a", "columns": [ITEM], **change}, "m")


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"none\.yaml: not readable"):
        DataContract.read(tmp_path / "none.yaml")
    (tmp_path / "broken.yaml").write_text("robot: [", encoding="utf-8")
    with pytest.raises(UserError, match=r"broken\.yaml: not readable"):
        DataContract.read(tmp_path / "broken.yaml")
