"""Folders of bags: found by their metadata alone, selected, and refused by name."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest

from msrd_ros.bags.writer import keep_stroke, write_bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.library import BagLibrary
from synthetic_strokes import at_root, stroke_messages, topics_of

PUSH, SLICE = StrategyLabel.parse("forehand-push"), StrategyLabel.parse("backhand-slice")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for subject in ("s01", "s02"):
        for label in (PUSH, SLICE, PUSH):
            stroke = stroke_messages(str(label))
            keep_stroke(tmp_path, subject, label, topics_of(stroke), at_root(stroke), {"outcome": "returned"})
    stroke = stroke_messages(str(PUSH))
    refused = {"outcome": "returned", "kept": "false", "reason": "joint_speed"}
    keep_stroke(tmp_path, "s02", PUSH, topics_of(stroke), at_root(stroke), refused)
    return tmp_path


def test_bags_are_found_in_order_and_selected(folder: Path) -> None:
    library = BagLibrary.scan(folder)
    assert [bag.path.relative_to(folder).as_posix() for bag in library.bags] == [
        "s01/backhand-slice_001",
        "s01/forehand-push_001",
        "s01/forehand-push_002",
        "s02/backhand-slice_001",
        "s02/forehand-push_001",
        "s02/forehand-push_002",
        "s02/forehand-push_003",
    ]
    assert library.refused == ()
    assert len(library.select()) == 6
    assert len(library.select(kept_only=False)) == 7
    assert [bag.subject for bag in library.select(labels=[SLICE])] == ["s01", "s02"]
    assert len(library.select(labels=[PUSH], subjects=["s02"])) == 2
    with pytest.raises(UserError, match=r"labels backhand-slice, forehand-push and subjects s01, s02"):
        library.select(subjects=["s03"])


def test_bags_that_say_they_are_unlabelled_are_selected_by_that(folder: Path) -> None:
    bare = stroke_messages("")
    path = keep_stroke(folder, "s01", None, topics_of(bare), at_root(bare), {"outcome": "returned"})
    silent = folder / "session"
    write_bag(silent, topics_of(bare), at_root(bare), {})
    library = BagLibrary.scan(folder)
    assert [bag.path for bag in library.select(labels=[None])] == [path]
    assert [bag.label for bag in library.select(labels=[None, SLICE])] == [SLICE, None, SLICE]
    assert {path, silent} <= {bag.path for bag in library.select()}
    assert path not in {bag.path for bag in library.select(labels=[PUSH, SLICE])}
    with pytest.raises(UserError, match="labels backhand-slice, forehand-push, unlabelled and subjects"):
        library.select(subjects=["s03"])


def test_one_bag_and_several_folders_are_folders_too(folder: Path) -> None:
    assert len(BagLibrary.scan(folder / "s01", folder / "s02" / "forehand-push_001").bags) == 4


def test_broken_bags_are_listed_or_refused_by_name(folder: Path) -> None:
    torn = next((folder / "s01" / "forehand-push_001").glob("*.mcap"))
    torn.write_bytes(torn.read_bytes()[:-100])
    (torn.parent / "metadata.yaml").unlink()
    (folder / "s01" / "forehand-push_002" / "metadata.yaml").write_text("{")
    (folder / "s02" / "backhand-slice_001").rename(folder / "s02" / "backhand-topspin_001")
    library = BagLibrary.scan(folder)
    assert len(library.bags) == 4
    assert len(library.refused) == 3
    for line, name, word in zip(
        library.refused,
        ("forehand-push_001", "forehand-push_002", "backhand-topspin_001"),
        ("cut off", "not readable", "custom_data says backhand-slice"),
        strict=True,
    ):
        assert name in line
        assert word in line
        assert "\n" not in line
    with pytest.raises(UserError, match="forehand-push_001"):
        BagLibrary.scan(folder, strict=True)


def test_hidden_directories_are_no_bags(folder: Path) -> None:
    (folder / "s01" / "forehand-push_001").rename(folder / "s01" / ".writing-1-0123abcd")
    shutil.copytree(folder / "s02" / "forehand-push_001", folder / ".discarded" / "forehand-push_001")
    assert len(BagLibrary.scan(folder).bags) == 6


def test_folders_without_bags_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="holds no bags"):
        BagLibrary.scan(tmp_path)
    with pytest.raises(UserError, match="does not exist"):
        BagLibrary.scan(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="is a file"):
        BagLibrary.scan(tmp_path / "file")


def test_hundreds_of_bags_are_scanned_in_a_moment(folder: Path) -> None:
    one = folder / "s01" / "forehand-push_001"
    for number in range(200):
        shutil.copytree(one, folder / f"t{number // 10}" / f"forehand-push_{number % 10 + 1:03d}")
    begin = time.process_time()
    library = BagLibrary.scan(folder)
    assert len(library.bags) == 207
    assert time.process_time() - begin < 3.0
