"""A stranger's data set becomes bags by a mapping file, or is refused with what to write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from edited_bags import shipped
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.columns import CONTRACT_KEY, stroke_contract
from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.exchange.importing import import_columns
from msrd_ros.recordings.exchange.lerobot_writer import LeRobotWriter
from sawyer import ROBOT

JOINTS = list(ROBOT.joint_names)
MOTORS = ["gripper", *(f"motor_{number}" for number in reversed(range(len(JOINTS))))]
"""The stranger's names and order."""
MAPPING: dict[str, Any] = {
    "robot": "sawyer",
    "subject": "stranger",
    "labels": {"hit it high": "my-lob", "do something": "unlabelled"},
    "columns": [
        {
            "feature": "observation.state",
            "entries": MOTORS[1:],
            "joints": JOINTS[::-1],
            "topic": "joint_states",
            "field": "position",
            "unit": "deg",
        },
        {
            "feature": "observation.ball",
            "entries": [1, 2, 3],
            "topic": "ball/position",
            "field": "point",
            "unit": "mm",
        },
    ],
}
STATE, BALL = MAPPING["columns"]


@pytest.fixture(scope="module")
def stroke() -> Episode:
    """What the stranger saw."""
    (episode,) = read_episodes(Bag(shipped()))
    return episode


@pytest.fixture(scope="module")
def strange(stroke: Episode, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three episodes: a stroke, the same without a label, and one in which the ball rests."""
    root = tmp_path_factory.mktemp("strange") / "set"
    root.mkdir()
    state = np.degrees(np.column_stack([stroke.joint_position[:, 0] * 0.0, stroke.joint_position[:, ::-1]]))
    ball = np.column_stack([np.ones(len(state)), 1e3 * stroke.ball_position])
    features: dict[str, dict[str, Any]] = {
        "observation.state": {"dtype": "float64", "shape": [len(MOTORS)], "names": MOTORS},
        "observation.ball": {"dtype": "float64", "shape": [4], "names": None},
    }
    with LeRobotWriter(root, 50, "strange", features) as writer:
        for task, seen in (
            ("hit it high", ball),
            ("do something", ball),
            ("hit it high", 0 * ball + ball[0]),
        ):
            writer.add(task, {"observation.state": state, "observation.ball": seen}, {})
    return root


def write(path: Path, **changes: object) -> Path:
    """A mapping file with keys changed, or left out where they are None."""
    told = {key: value for key, value in {**MAPPING, **changes}.items() if value is not None}
    path.write_text(yaml.safe_dump(told), encoding="utf-8")
    return path


def test_strokes_of_a_stranger_become_bags(strange: Path, stroke: Episode, tmp_path: Path) -> None:
    done = import_columns(strange, tmp_path / "bags", "lerobot", write(tmp_path / "m.yaml"))
    assert done.bags == 2
    (refused,) = done.refused
    assert refused.startswith("episode 2: ")
    assert "the ball" in refused
    for name, label in (("my-lob_001", "my-lob"), ("unlabelled_001", None)):
        bag = Bag(tmp_path / "bags" / "stranger" / name)
        (found,) = read_episodes(bag)
        assert (found.label, found.subject) == (label, "stranger")
        # Without velocities the first row tells no state, as in any bag.
        np.testing.assert_allclose(found.joint_position[:-1], stroke.joint_position[1:], atol=1e-12)
        np.testing.assert_allclose(found.ball_position[:-1], stroke.ball_position[1:], atol=1e-12)
        assert bag.info.custom_data[CONTRACT_KEY] == stroke_contract(ROBOT).to_json()
        assert str(strange) in bag.info.custom_data["note"]


@pytest.mark.parametrize(
    ("changes", "blame"),
    [
        ({"subject": None}, "lacks subject"),
        (
            {"labels": None},
            r"'hit it high' is no strategy label; .*or say labels: \{'hit it high': LABEL\} in",
        ),
        ({"labels": {"do something": "my-lob"}}, "labels lacks the task 'hit it high'"),
        ({"rate_hz": 30}, "rate_hz is 30, and LeRobot data set .* has 50 rows a second; leave it out"),
        ({"robot": "ur10e"}, "tells joints right_j6, .* and ur10e has shoulder_pan_joint"),
        ({"robot": "sawyer@123"}, "sawyer with other joints or limits"),
        ({"robot": "puma"}, "robot 'puma'"),
        ({"columns": [STATE]}, "says of no column that it is point of ball/position"),
        ({"columns": [BALL]}, "says of no column that it is position of joint_states"),
        ({"columns": [STATE, BALL, BALL]}, "point of ball/position is told twice"),
        (
            {"columns": [STATE, {**BALL, "feature": "ball"}]},
            "there is no feature 'ball'; there are observation.state",
        ),
        (
            {"columns": [STATE, {**BALL, "entries": [2, 3, 4]}]},
            "observation.ball has no entry 4; it has 4, from 0",
        ),
        (
            {"columns": [STATE, {**BALL, "entries": ["x", "y", "z"]}]},
            "no entry 'x'; .* none; use numbers from 0 to 3",
        ),
        (
            {"columns": [{**STATE, "entries": JOINTS}, BALL]},
            "no entry 'right_j0'; its entries' names are gripper",
        ),
        (
            {"columns": [{**STATE, "unit": "rad"}, BALL]},
            "no episode is accepted; episode 0: joint_limit, .* degrees",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(
    strange: Path, tmp_path: Path, changes: dict[str, object], blame: str
) -> None:
    with pytest.raises(UserError, match=blame):
        import_columns(strange, tmp_path / "bags", "lerobot", write(tmp_path / "m.yaml", **changes))
    assert not (tmp_path / "bags").exists()
