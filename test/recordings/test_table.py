"""A folder as a table: what the bags say, what the inspection says, and who stands out."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edited_bags import LABEL, edited, messages_of, shipped, write, write_edited, write_mcap
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings import table
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.episodes import cut_bag, read_episodes
from msrd_ros.recordings.row import Row
from msrd_ros.recordings.table import StrokeTable, rows
from synthetic_strokes import at_root, stroke_messages


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All shipped bags of two labels."""
    target = tmp_path_factory.mktemp("library") / "bags"
    for label in (LABEL, "backhand-slice"):
        for path in shipped_bags().glob(f"*/{label}_*"):
            shutil.copytree(path, target / path.parent.name / path.name)
    return target


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "bags"))


def by_bag(found: list[Row]) -> dict[str, Row]:
    assert len({row.bag for row in found}) == len(found)
    return {row.bag: row for row in found}


def test_a_row_says_what_its_bag_says(folder: Path) -> None:
    found = by_bag(rows(folder))
    assert len(found) == 18
    row = found[f"subject_01/{LABEL}_001"]
    (episode,) = read_episodes(Bag(folder / row.bag))
    outcome = episode.outcome
    assert outcome is not None
    assert (row.subject, row.label, row.outcome, row.verdict) == ("subject_01", LABEL, "returned", "accepted")
    assert row.length_s == pytest.approx(2.148)
    assert row.spin_rad_s == (outcome.spin_x_rad_s, outcome.spin_y_rad_s, outcome.spin_z_rad_s)
    assert row.landing_m == (outcome.landing_x_m, outcome.landing_y_m)
    assert row.missed == {"joint_states": 0, "ball/position": 0}
    assert (row.flags, row.marks, row.discarded) == ((), (), "")


def test_a_stroke_under_the_wrong_label_stands_out_and_the_others_do_not(copy: Path) -> None:
    assert Counter(bool(row.marks) for row in rows(copy)) == {False: 18}
    edit = Curation(copy).relabel(copy / f"subject_01/{LABEL}_001", "backhand-slice")
    marked = [row for row in rows(copy) if row.marks]
    assert [row.bag for row in marked] == [edit.to]
    assert "rad away" in marked[0].marks[0]


def test_strokes_without_a_label_are_held_against_nobody(copy: Path) -> None:
    for path in sorted(copy.glob("*/*")):
        Curation(copy).relabel(path, "unlabelled")
    found = rows(copy)
    assert Counter((row.label, row.verdict, row.marks) for row in found) == {
        ("unlabelled", "accepted", ()): 18
    }
    assert {row.distance_rad for row in found} == {None}
    assert all(row.jerk_rad_s3 for row in found)
    assert Counter(row.does.split(" (")[0] for row in found) == {
        "forehand, little spin": 9,
        "backhand, backspin": 9,
    }


def test_a_trembling_arm_stands_out_by_its_jerk(copy: Path) -> None:
    bag = f"subject_01/{LABEL}_001"

    def tremble(message: Any, number: int) -> Any:
        # 20 Hz, of an amplitude that the inspection lets pass.
        time_s = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
        phase = 2.0 * np.pi * 20.0 * time_s
        message.position = message.position + 0.0005 * np.sin(phase)
        message.velocity = message.velocity + 0.0005 * 2.0 * np.pi * 20.0 * np.cos(phase)
        return message

    shutil.rmtree(copy / bag)
    write_edited(copy / bag, joint_states=tremble)
    row = by_bag(rows(copy))[bag]
    assert row.verdict == "accepted"
    assert any("jerk" in mark for mark in row.marks)


def test_missing_samples_are_marked(copy: Path) -> None:
    bag = f"subject_01/{LABEL}_001"
    shutil.rmtree(copy / bag)
    write_edited(copy / bag, ball=lambda message, number: None if number % 20 == 7 else message)
    row = by_bag(rows(copy))[bag]
    assert row.missed is not None
    assert row.missed["ball/position"] > 10
    assert any("samples of ball/position are missing" in mark for mark in row.marks)


def test_a_missed_ball_and_a_broken_bag_have_rows_and_change_nobodys_marks(copy: Path) -> None:
    usual = by_bag(rows(copy))

    def missed(message: Any, _: int) -> Any:
        message.status[0].message = "net"
        for pair in message.status[0].values:
            pair.value = "false" if pair.key == "returned" else pair.value
        return message

    write(copy / "s9" / f"{LABEL}_001", edited(messages_of(), {"rally/outcome": missed}))
    (copy / "s9" / f"{LABEL}_002").mkdir()
    (copy / "s9" / f"{LABEL}_002" / "metadata.yaml").write_text("nonsense", encoding="utf-8")
    found = by_bag(rows(copy))
    net, broken = found.pop(f"s9/{LABEL}_001"), found.pop(f"s9/{LABEL}_002")
    assert (net.verdict, net.outcome, net.detail) == ("net", "net", "the ball was not returned")
    assert net.jerk_rad_s3 == pytest.approx(usual[f"subject_01/{LABEL}_001"].jerk_rad_s3)
    assert broken.verdict == "unreadable"
    assert broken.detail.startswith("metadata.yaml is not readable")
    assert found == usual


def test_strokes_of_others_have_what_is_known_and_no_more(tmp_path: Path) -> None:
    quiet = [message for message in messages_of() if message.topic != "/rally/outcome"]
    write_mcap(tmp_path / f"{LABEL}_001.mcap", quiet)
    write_mcap(tmp_path / "other.mcap", at_root(stroke_messages("my-smash")))
    first, second = rows(tmp_path)
    assert (first.outcome, first.spin_rad_s, first.landing_m, first.verdict) == ("", None, None, "accepted")
    assert second.label == "my-smash"
    assert second.landing_m is None, "the referee did not say"
    assert first.distance_rad is None, "there is no other of its label"
    assert rows(tmp_path / "other.mcap")[0].bag == "."


def test_discarded_strokes_are_listed_when_asked_for(copy: Path) -> None:
    curation = Curation(copy)
    bag = f"subject_01/{LABEL}_001"
    curation.flag(copy / bag, "late")
    edit = curation.discard(copy / bag)
    strokes = StrokeTable(copy)
    assert bag not in by_bag(strokes.rows())
    found = by_bag(strokes.rows(discarded=True))
    assert (found[edit.to].discarded, found[edit.to].flags) == (bag, ("late",))
    assert edit.to not in by_bag(rows(copy / "subject_02", discarded=True)), "not of this part of the library"
    (row,) = [row for row in rows(copy / "subject_01", discarded=True) if row.discarded]
    assert row.flags == ("late",)


def test_only_what_has_changed_is_read_again(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = []

    def counted(bag: Bag, *arguments: Any) -> Any:
        read.append(bag.info.path.name)
        return cut_bag(bag, *arguments)

    monkeypatch.setattr(table, "cut_bag", counted)
    strokes = StrokeTable(copy)
    strokes.rows()
    assert len(read) == 18
    read.clear()
    edit = Curation(copy).relabel(copy / f"subject_01/{LABEL}_001", "my-smash")
    assert edit.to in by_bag(strokes.rows())
    assert read == ["my-smash_001"]


def test_no_folder_is_refused_and_an_empty_one_has_no_rows(tmp_path: Path) -> None:
    assert rows(tmp_path) == []
    with pytest.raises(UserError, match="does not exist"):
        rows(tmp_path / "gone")
    assert rows(shipped())[0].bag == "."
