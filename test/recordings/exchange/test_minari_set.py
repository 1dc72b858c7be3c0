"""Minari itself loads and combines what is exported to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from libraries import copy_of
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.data_sets import demonstrations_from_minari
from msrd_ros.recordings.demonstrations import load_strokes
from msrd_ros.recordings.exchange.exporting import export_bags
from msrd_ros.recordings.exchange.importing import import_columns
from msrd_ros.recordings.exchange.minari_set import read_minari
from sawyer import ROBOT

minari: Any = pytest.importorskip("minari")
SUBJECTS = ("subject_01", "subject_02")
BAGS = ("backhand-slice_001", "forehand-push_001", "forehand-push_002")


@pytest.fixture
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two data sets where Minari looks for them."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    for subject in SUBJECTS:
        folder = copy_of(subject, *BAGS, target=tmp_path / "bags" / subject)
        export_bags(folder, tmp_path / "sets" / f"{subject}-v0", "minari", ROBOT, {})
    return [f"{subject}-v0" for subject in SUBJECTS]


def test_minari_loads_every_bit(names: list[str]) -> None:
    dataset = minari.load_dataset(names[0])
    strokes = load_strokes(shipped_bags() / SUBJECTS[0])
    wanted = [one for one in strokes if one.source.endswith(BAGS)]
    assert dataset.total_episodes == len(wanted) == len(BAGS)
    for found, stroke in zip(dataset.iterate_episodes(), wanted, strict=True):
        assert np.array_equal(found.observations, stroke.observations)
        assert np.array_equal(found.actions, stroke.actions)
        assert not found.terminations.any()
        assert found.truncations.tolist() == [False] * (len(stroke.actions) - 1) + [True]
    assert set(minari.list_local_datasets()) == set(names)


def test_combined_sets_keep_what_is_said_of_strokes(names: list[str], tmp_path: Path) -> None:
    combined = minari.combine_datasets([minari.load_dataset(name) for name in names], "both-v0")
    assert combined.total_episodes == len(SUBJECTS) * len(BAGS)
    table = read_minari(tmp_path / "sets" / "both-v0")
    told = [(one.facts["subject"], one.task, one.facts["outcome"]) for one in table.episodes(["actions"])]
    assert told == [(subject, bag.partition("_")[0], "returned") for subject in SUBJECTS for bag in BAGS]
    assert demonstrations_from_minari("both-v0").layout.labels == ("backhand-slice", "forehand-push")
    mapping = tmp_path / "sets" / names[0] / "msrd_ros" / "contract.yaml"
    done = import_columns(tmp_path / "sets" / "both-v0", tmp_path / "made", "minari", mapping)
    assert (done.bags, done.refused) == (len(told), ())
    for subject in SUBJECTS:
        assert sorted(path.name for path in (tmp_path / "made" / subject).iterdir()) == sorted(BAGS)
