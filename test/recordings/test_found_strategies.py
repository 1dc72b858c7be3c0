"""Strategies that were found and renamed become the labels of bags, and all of it can be taken back."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from edited_bags import LABEL
from libraries import contents, copy_of
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.command import main
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.found_strategies import FoundStrategies

PUSHES = [f"subject_01/{LABEL}_001", f"subject_01/{LABEL}_002"]
SLICE = "subject_02/backhand-slice_001"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copy_of("subject_02", "backhand-slice_001", target=tmp_path / "bags")
    return copy_of("subject_01", f"{LABEL}_001", f"{LABEL}_002", target=tmp_path / "bags")


def write(folder: Path, strategies: dict[str, list[str]], doubted: tuple[str, ...] = ()) -> Path:
    """A file as a trainer writes it, beside the folder."""

    def entry(bag: str) -> dict[str, Any]:
        return {"bag": str(folder / bag), "belief": 0.9}

    content = {
        "strategies": {name: list(map(entry, bags)) for name, bags in strategies.items()},
        "doubted": [{**entry(bag), "label": LABEL, "strategy": "strategy-2"} for bag in doubted],
        "does": {},
    }
    path = folder.parent / "strategies.json"
    path.write_text(json.dumps(content))
    return path


def labels(folder: Path) -> dict[str, str]:
    """Labels of a folder's bags by name, as their metadata say them."""
    return {path.parent.name: path.read_text() for path in folder.glob("*/*/metadata.yaml")}


def test_bags_get_the_names_that_a_person_gave_and_it_is_taken_back(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(folder)
    file = write(folder, {"my-push": PUSHES, "backhand-slice": [SLICE]})
    assert main(["relabel", "--from", str(file), str(folder)]) == 0
    *edits, total = capsys.readouterr().out.splitlines()
    assert total == "2 edits"
    assert all(edit.endswith(f"label {LABEL} -> my-push") for edit in edits)
    assert sorted(labels(folder)) == ["backhand-slice_001", "my-push_001", "my-push_002"]
    assert main(["restore", str(folder / "edit-2")]) == 0
    assert main(["restore", str(folder / "edit-1")]) == 0
    assert contents(folder) == before


def test_a_doubted_bag_keeps_its_label_and_is_flagged_once(folder: Path) -> None:
    file = write(folder, {"backhand-slice": [PUSHES[0], SLICE], LABEL: [PUSHES[1]]}, (PUSHES[0],))
    before = contents(folder)
    found = FoundStrategies.read(file)
    assert [edit.verb for edit in found.relabel(folder)] == ["flag"]
    assert list(found.relabel(folder)) == []
    assert contents(folder) == before
    assert Curation(folder).flags() == {PUSHES[0]: (f"says {LABEL}, but is rather backhand-slice",)}
    write(folder, {"backhand-slice": [PUSHES[0], SLICE], LABEL: [PUSHES[1]]})
    assert [edit.verb for edit in FoundStrategies.read(file).relabel(folder)] == ["relabel"]


def test_what_was_cut_off_goes_on(folder: Path) -> None:
    # The bags change names: the first one's is free for the third by then.
    found = FoundStrategies.read(write(folder, {"backhand-slice": PUSHES, LABEL: [SLICE]}))
    edits = found.relabel(folder)
    assert next(edits).to == "subject_01/backhand-slice_001"
    again = list(found.relabel(folder))
    assert [edit.bag for edit in again] == [PUSHES[1], SLICE]
    assert list(found.relabel(folder)) == []


def test_only_bags_of_the_folder_are_relabelled(folder: Path) -> None:
    found = FoundStrategies.read(write(folder, {"my-stroke": [*PUSHES, SLICE]}))
    assert [edit.bag for edit in found.relabel(folder / "subject_02")] == [SLICE]


def test_two_strategies_of_one_name_are_one(folder: Path) -> None:
    file = write(folder, {"strategy-1": PUSHES, "strategy-2": [SLICE]})
    file.write_text(re.sub("strategy-[12]", "my-stroke", file.read_text()))
    assert set(FoundStrategies.read(file).labels.values()) == {"my-stroke"}
    assert len(FoundStrategies.read(file).labels) == 3


@pytest.mark.parametrize(
    ("content", "blame"),
    [
        ("[1, 2]", "is no list of strategies; give the strategies.json"),
        ('{"strategies": {}}', "is no list of strategies"),
        ("{", "is no list of strategies"),
        ('{"strategies": {"My Smash": [{"bag": "a"}]}, "doubted": []}', "'My Smash' is no strategy label"),
        ('{"strategies": {"a": [{"index": 3}]}, "doubted": []}', "a: {'index': 3} names no bag"),
        ('{"strategies": {"a": [{"bag": "x"}], "b": [{"bag": "x"}]}, "doubted": []}', "is of a and of b"),
    ],
)
def test_a_file_that_says_something_else_is_refused(tmp_path: Path, content: str, blame: str) -> None:
    file = tmp_path / "strategies.json"
    file.write_text(content)
    with pytest.raises(UserError, match=re.escape(blame)):
        FoundStrategies.read(file)


def test_a_bag_that_is_not_there_stops_all_before_anything_is_changed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(folder)
    file = write(folder, {"my-push": [*PUSHES, "subject_01/gone_001"]})
    assert main(["relabel", "--from", str(file), str(folder)]) == 2
    assert "gone_001: does not exist" in capsys.readouterr().err
    assert contents(folder) == before


def test_calls_that_cannot_be_meant_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(folder, {"my-push": PUSHES})
    for arguments in ([], ["my-push", "--from", str(file)]):
        assert main(["relabel", str(folder / PUSHES[0]), *arguments]) == 2
        assert "give a LABEL for one bag, or --from FILE for a folder" in capsys.readouterr().err
    assert main(["relabel", str(folder / SLICE), "--from", str(file)]) == 2
    assert "names no bag in" in capsys.readouterr().err
    with pytest.raises(UserError, match="cannot be read"):
        FoundStrategies.read(folder / "nothing.json")
