"""A data set holds what learning sees of a folder of bags, under names, with units; or there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exchanged_bags import GOOD, LONE, LONG, REFUSED, STROKES, Exported
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.learning.lerobot_files import LeRobotFiles
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.exchange.exporting import export_bags
from sawyer import ROBOT


def test_rows_are_what_learning_sees(bags: Path, exported: Exported) -> None:
    names = ["observation.state", "observation.environment_state", "action", "joint_velocity"]
    found = LeRobotFiles.open(exported["lerobot"][0]).episodes(names)
    assert len(found) == STROKES
    by_bag = {(one.facts["bag"], one.facts["stroke"]): one for one in found}
    for path in (*GOOD, LONE, LONG):
        for number, episode in enumerate(read_episodes(Bag(bags / path))):
            rows, facts = by_bag[path, number].rows, by_bag[path, number].facts
            count = len(episode.actions)
            seen = np.concatenate([rows["observation.state"], rows["observation.environment_state"]], axis=1)
            assert np.array_equal(seen, episode.observations[:count].astype(np.float32))
            assert np.array_equal(rows["action"], episode.actions.astype(np.float32))
            assert np.array_equal(rows["joint_velocity"], episode.joint_velocity[:count].astype(np.float32))
            assert facts["start_ns"] == episode.start_ns
            assert episode.outcome is None or facts["outcome"] == episode.outcome.message
            assert (facts["subject"], facts["label"]) == (episode.subject, str(episode.label or ""))
            assert by_bag[path, number].task == (episode.label or "unlabelled")


def test_features_have_names_and_units(exported: Exported) -> None:
    features = LeRobotFiles.open(exported["lerobot"][0]).features
    assert features["observation.state"]["names"] == list(ROBOT.joint_names)
    assert features["observation.state"]["units"] == ["rad"] * ROBOT.joint_count
    assert features["observation.environment_state"]["units"] == ["m"] * 3 + ["m/s"] * 3
    assert features["action"]["units"] == ["speed_fraction"] * ROBOT.joint_count


def test_nothing_is_written_over_and_nothing_is_left_half(bags: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="exists; name a folder that does not"):
        export_bags(bags, tmp_path, "lerobot", ROBOT, {})
    with pytest.raises(UserError, match="whose strokes would count twice"):
        export_bags(bags, bags / "odd" / "new", "lerobot", ROBOT, {})
    with pytest.raises(UserError, match="leave out --video"):
        export_bags(bags, tmp_path / "new-v0", "minari", ROBOT, {}, video=True)
    with pytest.raises(UserError, match="is no name of a Minari data set"):
        export_bags(bags, tmp_path / "new", "minari", ROBOT, {})
    with pytest.raises(UserError, match=r"no stroke is accepted; frozen: joint_velocity"):
        export_bags(bags / REFUSED, tmp_path / "new", "lerobot", ROBOT, {})
    with pytest.raises(UserError, match="does not exist"):
        export_bags(tmp_path / "none", tmp_path / "new", "lerobot", ROBOT, {})
    assert not list(tmp_path.iterdir())
