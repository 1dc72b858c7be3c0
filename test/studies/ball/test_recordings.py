"""Reading recordings: what is taken, and what is refused by name."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from made_up_recordings import COLUMNS, write_flights
from msrd_ros.core.errors import UserError
from msrd_ros.studies.ball.law import LAW
from msrd_ros.studies.ball.recordings import read_events, read_flights

ROW = "Ann,/game_0/rally_0/event{},{},{},[ 1.  0.5 0.02],[-4. 0. 2.],[0. -100. 5.]"


def _write(folder: Path, *rows: str, head: str = COLUMNS) -> Path:
    (folder / "match_events.csv").write_text("\n".join((head, *rows)) + "\n")
    return folder


def test_events_come_by_rally_and_number(tmp_path: Path) -> None:
    events = read_events(
        _write(
            tmp_path, ROW.format(2, "bounce_p1", 0.4), ROW.format(1, "shot_p2", 0.1).replace("5.]", "nan]")
        )
    )
    assert events is not None
    assert events.kind.tolist() == ["shot_p2", "bounce_p1"]
    assert events.rally.tolist() == ["Ann /game_0/rally_0"] * 2
    np.testing.assert_allclose(events.balls[1], [1.0, 0.5, 0.02, -4.0, 0.0, 2.0, 0.0, -100.0, 5.0])
    assert np.isnan(events.balls[0]).sum() == 1


def test_a_folder_without_recordings_has_none(tmp_path: Path) -> None:
    assert read_events(tmp_path) is None
    assert read_flights(tmp_path) is None


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("Ann,/game_0/rally_0,shot_p1,0.1,[1 2 3],[1 2 3],[1 2 3]", "line 2: rally_id"),
        ("Ann,/g/r/event1,volley,0.1,[1 2 3],[1 2 3],[1 2 3]", "line 2: type is 'volley'"),
        ("Ann,/g/r/event1,shot_p1,soon,[1 2 3],[1 2 3],[1 2 3]", "line 2: timestamp is 'soon'"),
        ("Ann,/g/r/event1,shot_p1,0.1,[1 2],[1 2 3],[1 2 3]", "line 2: ball_pos"),
        ("Ann,/g/r/event1,shot_p1,0.1,[1 2 3],[1 2 fast],[1 2 3]", "line 2: ball_vel_out"),
        ("Ann,/g/r/event1,shot_p1,0.1,[1 2 3]", "line 2: too short"),
    ],
)
def test_malformed_events_are_refused_with_their_line(tmp_path: Path, row: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        read_events(_write(tmp_path, row))


def test_events_of_another_form_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="without column ball_spin_out"):
        read_events(_write(tmp_path, head=COLUMNS.replace(",ball_spin_out", "")))
    with pytest.raises(UserError, match="no events"):
        read_events(_write(tmp_path))
    with pytest.raises(UserError, match="two events 1"):
        read_events(_write(tmp_path, ROW.format(1, "shot_p2", 0.1), ROW.format(1, "shot_p2", 0.2)))
    with pytest.raises(UserError, match=r"event 2 .* before the last"):
        read_events(_write(tmp_path, ROW.format(1, "shot_p2", 0.4), ROW.format(2, "bounce_p1", 0.1)))


def test_flights_are_read_packed_or_not(tmp_path: Path) -> None:
    write_flights(tmp_path, LAW, count=2)
    plain = read_flights(tmp_path)
    assert plain is not None
    packed = tmp_path / "packed"
    packed.mkdir()
    with zipfile.ZipFile(packed / "flights.zip", "w") as archive:
        for file in (tmp_path / "flights").iterdir():
            archive.write(file, f"trajectories/{file.name}")
    again = read_flights(packed)
    assert again is not None
    assert [flight.name for flight in again] == ["001.csv", "002.csv"]
    np.testing.assert_array_equal(again[1].positions, plain[1].positions)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.0;1;2\n0.1;1;2\n", "t;x;y;z"),
        ("0.1;1;2;3\n0.0;1;2;3\n", "times fall"),
        ("a;b;c;d\n", "t;x;y;z"),
        ("0.0;1;2;nan\n0.1;1;2;3\n", "finite"),
    ],
)
def test_malformed_flights_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    write_flights(tmp_path, LAW, count=1)
    (tmp_path / "flights" / "001.csv").write_text(text)
    with pytest.raises(UserError, match=rf"001\.csv: .*{message}"):
        read_flights(tmp_path)


def test_missing_and_broken_files_are_refused(tmp_path: Path) -> None:
    write_flights(tmp_path, LAW, count=1)
    (tmp_path / "flights" / "001.csv").unlink()
    with pytest.raises(UserError, match=r"001\.csv: missing"):
        read_flights(tmp_path)
    (tmp_path / "flights.zip").write_text("no zip")
    with pytest.raises(UserError, match="not a zip"):
        read_flights(tmp_path)
