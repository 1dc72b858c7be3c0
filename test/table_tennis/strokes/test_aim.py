"""The command that teaches targets: what it refuses before it works."""

from __future__ import annotations

from pathlib import Path

import pytest

from made_up_policies import made_up_policies
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strokes.aim import main, say_reach
from msrd_ros.table_tennis.strokes.reach import Reach


@pytest.fixture
def policies(tmp_path: Path) -> Path:
    path = tmp_path / "policies.safetensors"
    path.write_bytes(made_up_policies().to_bytes())
    return path


def test_a_file_that_is_there_is_not_replaced(policies: Path) -> None:
    before = policies.read_bytes()
    with pytest.raises(UserError, match="is there already; give another file, or --overwrite"):
        main([str(policies), str(policies)])
    assert policies.read_bytes() == before


@pytest.mark.parametrize("option", [("--seed", "-1"), ("--threads", "0")])
def test_numbers_that_mean_nothing_are_refused(
    policies: Path, tmp_path: Path, option: tuple[str, str]
) -> None:
    with pytest.raises(UserError, match="--seed is a whole number from 0, --threads one from 1"):
        main([str(policies), str(tmp_path / "out"), *option])


def test_policies_of_another_arm_are_refused(policies: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="sawyer"):
        main([str(policies), str(tmp_path / "out"), "--robot", "ur10e"])
    assert not (tmp_path / "out").exists()


def test_the_reach_is_said_of_those_that_have_one() -> None:
    assert say_reach(made_up_policies()) == []
    said = say_reach(made_up_policies(reach=Reach.grid([0.4, 0.8], [-0.2, 0.2])))
    assert said[0] == "forehand-push: 0 of 4 targets in reach"
