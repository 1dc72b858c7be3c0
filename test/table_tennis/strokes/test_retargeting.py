"""Strokes of one arm as strokes of another: the blade goes the same way, and no limit is passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrd_ros.contract.episode import ACTING_STEPS, FIRST_ACTING_STEP, HORIZON
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strokes.policies import rally_policies
from msrd_ros.table_tennis.strokes.retargeting import RetargetingConfig, follow, play_returned, retarget

SAWYER, UR10E = load_robot("sawyer"), load_robot("ur10e")
FEW = RetargetingConfig(strokes=2, starts=6)


@pytest.fixture(scope="module")
def shown() -> dict[StrategyLabel, np.ndarray]:
    return play_returned(rally_policies(SAWYER), FEW)


def centres(robot: Robot, joints: np.ndarray) -> np.ndarray:
    return np.array([paddle_pose(robot.model, posture)[0] for posture in joints])


def test_the_other_arm_brings_the_blade_the_same_way(shown: dict[StrategyLabel, np.ndarray]) -> None:
    found = retarget(shown, SAWYER, UR10E, FEW)
    assert len(found.episodes) == sum(map(len, shown.values()))
    assert max(found.miss_m.values()) < 0.04
    episode, label = found.episodes[0], next(iter(shown))
    assert (episode.label, episode.robot) == (label, UR10E)
    assert len(episode.joint_position) == HORIZON + 1
    acting = slice(FIRST_ACTING_STEP, FIRST_ACTING_STEP + ACTING_STEPS)
    before = np.asarray(shown[label][0, :ACTING_STEPS, : SAWYER.joint_count], dtype=np.float64)
    apart = centres(UR10E, episode.joint_position[acting]) - centres(SAWYER, before)
    assert np.linalg.norm(apart, axis=1).mean() < 0.04
    np.testing.assert_array_equal(episode.ball_position[FIRST_ACTING_STEP:], shown[label][0, :, 7:10])
    limits = UR10E.limits
    for each in found.episodes:
        assert (np.abs(each.joint_velocity) <= limits.speed_rad_s + 1e-9).all()
        assert (each.joint_position >= limits.lower_rad).all()
        assert (each.joint_position <= limits.upper_rad).all()


def test_what_is_too_fast_stays_behind(shown: dict[StrategyLabel, np.ndarray]) -> None:
    there, far = np.array([-1.5, 0.0, 1.1]), np.array([-1.5, 0.4, 1.1])
    places = np.concatenate([np.repeat(there[None], 2, 0), np.repeat(far[None], 4, 0)])
    normals = np.tile([1.0, 0.0, 0.0], (6, 1))
    followed = follow(SAWYER, [(places, normals)], SAWYER.home_rad, 6)
    went = followed.position[0, -1] - followed.position[0, 0]
    assert (np.abs(went) <= 5 * 0.02 * SAWYER.limits.speed_rad_s + 1e-9).all()
    assert np.linalg.norm(centres(SAWYER, followed.position[0])[-1] - far) > 0.05


def test_an_arm_that_does_not_get_there_is_told(shown: dict[StrategyLabel, np.ndarray]) -> None:
    label = next(iter(shown))
    model = SAWYER.model.copy()
    model["base_position"][0, 0] -= 5.0
    with pytest.raises(UserError, match=f"ur10e: cannot bring its blade to where {label} waits"):
        retarget({label: shown[label]}, replace(SAWYER, model=model), UR10E, FEW)
