"""The verbs that list a folder and edit its bags: what a person types and reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from edited_bags import LABEL
from libraries import contents, copy_of
from msrd_ros.recordings.command import main

BAG = f"subject_01/{LABEL}_001"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copy_of("subject_02", "backhand-slice_001", target=tmp_path / "bags")
    return copy_of("subject_01", f"{LABEL}_001", f"{LABEL}_002", target=tmp_path / "bags")


def listed(folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> list[str]:
    status = main(["list", str(folder), "--json", *options])
    bags = [row["bag"] for row in json.loads(capsys.readouterr().out)]
    assert status == (0 if bags else 1)
    return bags


def test_a_folder_is_listed_filtered_and_sorted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slice_bag, second = "subject_02/backhand-slice_001", f"subject_01/{LABEL}_002"
    assert listed(folder, capsys) == [BAG, second, slice_bag]
    assert listed(folder, capsys, "--label", LABEL) == [BAG, second]
    assert listed(folder, capsys, "--subject", "subject_02") == [slice_bag]
    assert listed(folder, capsys, "--sort", "spin") == [slice_bag, BAG, second]
    assert listed(folder, capsys, "--sort", "jerk") == [slice_bag, second, BAG]
    assert listed(folder, capsys, "--outliers") == []
    assert listed(folder, capsys, "--discarded") == []
    assert main(["list", str(folder)]) == 0
    head, *lines, total = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["bag", "subject", "label"]
    assert [line.split()[0] for line in lines] == [BAG, second, slice_bag]
    assert total == "3 strokes, 3 accepted, 0 marked as outliers"


def test_a_bag_is_edited_and_all_is_taken_back(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(folder)
    smash = folder / "subject_01" / "my-smash_001"
    assert main(["relabel", str(folder / BAG), "my-smash"]) == 0
    assert "now subject_01/my-smash_001: label forehand-push -> my-smash" in capsys.readouterr().out
    assert main(["trim", str(smash), "0.1", "2.2"]) == 0
    assert main(["flag", str(smash), "look again"]) == 0
    assert main(["list", str(folder), "--label", "my-smash"]) == 0
    assert "look again" in capsys.readouterr().out
    assert main(["unflag", str(smash)]) == 0
    assert main(["discard", str(smash)]) == 0
    assert main(["list", str(folder), "--discarded"]) == 0
    assert "was subject_01/my-smash_001" in capsys.readouterr().out
    assert main(["restore", str(smash)]) == 0
    assert main(["restore", str(folder / "edit-2")]) == 0
    assert main(["restore", str(smash)]) == 0
    assert contents(folder) == before


def test_strokes_without_a_label_are_listed_described_checked_and_labelled(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["relabel", str(folder / "subject_02/backhand-slice_001"), "unlabelled"]) == 0
    assert capsys.readouterr().out.endswith("label backhand-slice -> unlabelled\n")
    bare = "subject_02/unlabelled_001"
    assert listed(folder, capsys, "--label", "unlabelled") == [bare]
    assert listed(folder, capsys, "--sort", "label")[-1] == bare
    assert main(["list", str(folder), "--label", "unlabelled"]) == 0
    (_, line, total) = capsys.readouterr().out.splitlines()
    assert line.split()[:3] == [bare, "subject_02", "unlabelled"]
    assert re.search(r"backhand, backspin \(-\d+ rad/s\), \d\.\d m/s, lands \d\.\d\d m beyond the net", line)
    assert total == "1 stroke, 1 accepted, 0 marked as outliers"
    assert main(["check", str(folder)]) == 0
    checked = capsys.readouterr().out
    assert f"{bare}: 1 stroke\n  note: unlabelled: no strategy label; give it one with" in checked
    assert checked.count("note:") == 1
    assert main(["trim", str(folder / bare), "0.1", "2.2"]) == 0
    assert main(["discard", str(folder / bare)]) == 0
    assert main(["restore", str(folder / bare)]) == 0
    assert main(["relabel", str(folder / bare), "my-cut"]) == 0
    assert "label unlabelled -> my-cut" in capsys.readouterr().out
    assert listed(folder, capsys, "--label", "my-cut") == ["subject_02/my-cut_001"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["relabel", BAG, "My Smash"], "relabel: error: label: 'My Smash' is no strategy label"),
        (["trim", BAG, "0.1", "1.5"], "trim: error: bag .*: cut so, it would be no stroke"),
        (["discard", "subject_01/nothing"], "discard: error: bag .*: does not exist"),
        (["restore", BAG], "restore: error: bag .*: was not edited"),
        (["restore", "edit-9"], "restore: error: bag .*: was not edited"),
        (["unflag", BAG], "unflag: error: bag .*: has no such flag; it has none"),
        (["list", "nowhere"], "list: error: folder .*: does not exist"),
    ],
)
def test_a_wrong_call_is_one_line_and_changes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], reason: str
) -> None:
    before = contents(folder)
    verb, path, *others = arguments
    assert main([verb, str(folder / path), *others]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert re.match(reason, error)
    assert contents(folder) == before
