"""Folders of bags as data sets of the learning library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from libraries import copy_of
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.demonstrations import demonstrations, load_strokes
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations
from sawyer import JOINT_NAMES


def test_shipped_bags_are_demonstrations_of_the_library() -> None:
    found = demonstrations(shipped_bags(), labels=["forehand-push", "backhand-slice"])
    assert found.layout.labels == ("forehand-push", "backhand-slice")
    assert found.layout.observation_names[:7] == JOINT_NAMES
    assert found.observations.shape[:2] == (2, 9)
    assert found.actions.shape[-1] == len(JOINT_NAMES)


def test_bags_of_another_arm_are_refused_by_its_name_or_by_what_they_lack() -> None:
    with pytest.raises(UserError, match="sawyer, not ur10e"):
        demonstrations(next(shipped_bags().glob("*/forehand-push_001")), robot="ur10e")
    earlier = Path(__file__).parents[1] / "data" / "0.1.0" / "bags"
    with pytest.raises(UserError, match="shoulder_pan_joint"):
        demonstrations(earlier, robot="ur10e")


def test_no_bags_is_an_error_that_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=str(tmp_path)):
        demonstrations(tmp_path)


def test_strokes_without_a_label_are_left_out_unless_they_are_wanted(tmp_path: Path) -> None:
    folder = copy_of("subject_01", "forehand-push_001", "backhand-slice_001", target=tmp_path / "bags")
    Curation(folder).relabel(folder / "subject_01" / "backhand-slice_001", "")
    bare = folder / "subject_01" / "unlabelled_001"
    with pytest.warns(UserWarning, match=rf"left out: bag {bare}: no_label, .*relabel.*labels:=discover"):
        assert demonstrations(folder).layout.labels == ("forehand-push",)
    with pytest.raises(UserError, match=rf"no demonstration is left; bag {bare}: no_label"):
        demonstrations(bare)

    strokes = load_strokes(folder, unlabelled=True)
    assert [stroke.label for stroke in strokes] == ["forehand-push", None]
    (only,) = load_strokes(folder, labels=["unlabelled"], unlabelled=True)
    assert (only.label, only.source) == (None, f"bag {bare}")
    with pytest.raises(UserError, match=rf"bag {bare}: no strategy label"):
        gather_demonstrations(strokes, Strategies.shipped())
    found = [replace(stroke, label=stroke.label or StrategyLabel("strategy-1")) for stroke in strokes]
    gathered = gather_demonstrations(found, Strategies.shipped())
    assert gathered.layout.labels == ("forehand-push", "strategy-1")
