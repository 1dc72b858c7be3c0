"""What strategy rewards see of the arm: the same from every arm that brings the blade to the same place."""

from __future__ import annotations

import copy

import numpy as np
import torch

from msrd_ros.contract.episode import CONTROL_PERIOD_S, PADDLE_NAMES
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns


def test_columns_are_pose_and_motion_of_the_blade() -> None:
    for name in ("sawyer", "ur10e"):
        robot = load_robot(name)
        rates = np.linspace(-0.5, 0.5, robot.joint_count)
        before = robot.home_rad
        after = before + CONTROL_PERIOD_S * rates
        rows = [torch.as_tensor(np.concatenate([joints, np.full(6, 9.0)])) for joints in (before, after)]
        found = PaddleColumns(robot)(*(row.expand(2, 3, -1) for row in rows))
        assert found.shape == (2, 3, len(PADDLE_NAMES))
        place, rotation = paddle_pose(robot.model, after)
        expected = np.concatenate([place, rotation[:, 1]])
        np.testing.assert_allclose(found[1, 2, :6], expected, atol=1e-6)
        velocity = paddle_jacobian(robot.model, (before + after) / 2)[:3] @ rates
        np.testing.assert_allclose(found[1, 2, 6:], velocity, atol=1e-3)


def test_copies_of_rewards_share_them() -> None:
    columns = PaddleColumns(load_robot("sawyer"))
    assert copy.deepcopy([columns])[0] is columns
