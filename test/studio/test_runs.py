"""Folders of runs: names, states, what is said of each, and that a run keeps the bags it learned from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from libraries import copy_of
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import write_report
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.studio.runs import BAGS_FOLDER, Runs, link_bags

REPORT: dict[str, Any] = {
    "labels": ["my-drive"],
    "config": {"iterations": 80, "seed": 3},
    "demonstrations": {"my-drive": 12},
    "strategy_rewards": ["my-drive"],
    "strategy_matrix": [[0.0]],
    "iterations": 80,
    "curve": [
        {"iteration": 0, "seconds": 1.0, "struck": [0.5], "returned": [0.25]},
        {"iteration": 80, "seconds": 60.04, "struck": [1.0], "returned": [0.9]},
    ],
}


def make(folder: Path, name: str, **changes: Any) -> Path:
    run = folder / name
    run.mkdir(parents=True)
    write_report(run / "training.json", {**REPORT, **changes})
    return run


def test_a_run_says_what_it_learned_from_and_what_it_reached(tmp_path: Path) -> None:
    make(tmp_path, "drive")
    (told,) = Runs(tmp_path).all()
    assert told["name"] == "drive"
    assert told["state"] == "done"
    assert (told["iterations"], told["planned"], told["seed"], told["seconds"]) == (80, 80, 3, 60.0)
    assert (told["labels"], told["demonstrations"]) == (["my-drive"], {"my-drive": 12})
    assert (told["struck"], told["returned"]) == ([1.0], [0.9])
    assert not told["plays"]
    assert not told["goes_on"]


def test_a_stroke_without_a_label_is_nothing_to_learn_from(tmp_path: Path) -> None:
    folder = copy_of("subject_01", "forehand-push_001", "forehand-push_002", target=tmp_path / "bags")
    Curation(folder).relabel(folder / "subject_01" / "forehand-push_001", "unlabelled")
    with pytest.raises(UserError, match="subject_01 unlabelled_001: no strategy label; give it one"):
        link_bags(tmp_path / "drive", BagLibrary.scan(folder).bags)
    assert not (tmp_path / "drive").exists()


def test_only_what_stopped_and_has_its_bags_goes_on(tmp_path: Path) -> None:
    run = make(tmp_path, "drive", iterations=7)
    runs = Runs(tmp_path)
    assert runs.about("drive")["state"] == "stopped"
    assert not runs.about("drive")["goes_on"]
    (run / "checkpoint.safetensors").touch()
    link_bags(run, BagLibrary.scan(shipped_bags() / "subject_01").bags)
    assert runs.about("drive")["goes_on"]
    assert runs.about("drive", runs=True)["state"] == "running"
    assert not runs.about("drive", runs=True)["goes_on"]


def test_links_are_read_as_the_bags_themselves(tmp_path: Path) -> None:
    bags = BagLibrary.scan(shipped_bags() / "subject_01").bags
    folder = link_bags(tmp_path / "drive", [*bags, *BagLibrary.scan(shipped_bags() / "subject_02").bags])
    linked = BagLibrary.scan(folder)
    assert linked.refused == ()
    assert [bag.label for bag in linked.bags][: len(bags)] == [bag.label for bag in bags]
    assert len(linked.bags) == 36
    # Of a run that has only begun, they are all there is to say.
    counts = Runs(tmp_path).about("drive", runs=True)["demonstrations"]
    assert sum(counts.values()) == 36


@pytest.mark.parametrize("content", ["", "[]", '{"format": 99}'])
def test_a_broken_run_is_listed_with_what_is_wrong(tmp_path: Path, content: str) -> None:
    (make(tmp_path, "drive") / "training.json").write_text(content)
    told = Runs(tmp_path).about("drive")
    assert told["state"] == "broken"
    assert "training.json" in told["trouble"]


def test_a_run_that_ended_before_it_learned_anything_says_so(tmp_path: Path) -> None:
    (tmp_path / "drive" / BAGS_FOLDER).mkdir(parents=True)
    assert Runs(tmp_path).about("drive")["trouble"] == "it ended before anything was learned"


@pytest.mark.parametrize("name", ["", "../up", "a b", ".hidden", "a" * 65, "a/b"])
def test_other_names_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match="is no name of a run"):
        Runs(tmp_path).place(name)


def test_a_name_that_no_run_has_is_offered(tmp_path: Path) -> None:
    runs = Runs(tmp_path / "runs")
    assert runs.all() == []
    assert runs.free_name() == "run-1"
    make(tmp_path / "runs", "run-1")
    assert runs.free_name() == "run-2"
    with pytest.raises(UserError, match="there is no run 'run-2'"):
        runs.find("run-2")


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "drive").write_text("a file")
    with pytest.raises(UserError, match="cannot be written"):
        link_bags(tmp_path / "drive", BagLibrary.scan(shipped_bags() / "subject_01").bags)
