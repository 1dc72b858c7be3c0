"""Folders of bags as data sets of the learning library."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.demonstrations import demonstrations
from sawyer import JOINT_NAMES


def test_shipped_bags_are_demonstrations_of_the_library() -> None:
    found = demonstrations(shipped_bags(), labels=["forehand-push", "backhand-slice"])
    assert found.layout.labels == ("forehand-push", "backhand-slice")
    assert found.layout.observation_names[:7] == JOINT_NAMES
    assert found.observations.shape[:2] == (2, 9)
    assert found.actions.shape[-1] == len(JOINT_NAMES)


def test_bags_of_another_arm_are_refused_by_what_they_lack() -> None:
    with pytest.raises(UserError, match="shoulder_pan_joint"):
        demonstrations(next(shipped_bags().glob("*/forehand-push_001")), robot="ur10e")


def test_no_bags_is_an_error_that_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=str(tmp_path)):
        demonstrations(tmp_path)
