"""Forward, differential and inverse kinematics of the paddle."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.robots.inverse_kinematics import joint_rates_for_twist, reach_blade, reach_pose
from msrd_ros.robots.kinematics import link_frames, paddle_jacobian, paddle_pose
from msrd_ros.robots.rotations import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    turn_between,
    turned,
)
from sawyer import ARM, POSITION_LOWER_RAD, POSITION_UPPER_RAD, ROBOT

PLAYING_POSTURE = np.array([0.0, 0.6, -1.2, 0.5, -0.5, 1.5, 0.0])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def _any_posture(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(POSITION_LOWER_RAD, POSITION_UPPER_RAD)


def test_the_arm_stretched_out_has_the_published_lengths() -> None:
    # All joints at zero, Sawyer reaches straight forward: the published offsets simply add up.
    position, rotation = paddle_pose(ARM, np.zeros(7))
    forward = 0.081 + 0.14 + 0.26 + 0.125 + 0.275 + 0.11 + 0.2045
    left = 0.05 + 0.1425 - 0.042 - 0.1265 + 0.031 + 0.1053
    up = 0.91 + 0.08 + 0.237
    np.testing.assert_allclose(position, [-2.30 + forward, left, up], atol=1e-5)
    np.testing.assert_allclose(rotation[:, 2], [1.0, 0.0, 0.0], atol=1e-4)


def test_the_last_link_frame_carries_the_paddle(rng: np.random.Generator) -> None:
    for _ in range(20):
        joints = _any_posture(rng)
        position, rotation = paddle_pose(ARM, joints)
        origins, rotations = link_frames(ARM, joints)
        np.testing.assert_allclose(rotations[6], rotation, atol=1e-15)
        np.testing.assert_allclose(origins[6] + 0.2045 * rotation[:, 2], position, atol=1e-15)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_the_jacobian_is_the_derivative_of_the_pose(rng: np.random.Generator) -> None:
    step = 1e-6
    for _ in range(20):
        joints = _any_posture(rng)
        numeric = np.empty((6, 7))
        for joint in range(7):
            shift = np.zeros(7)
            shift[joint] = step
            after, rotation_after = paddle_pose(ARM, joints + shift)
            before, rotation_before = paddle_pose(ARM, joints - shift)
            numeric[:3, joint] = (after - before) / (2 * step)
            numeric[3:, joint] = turn_between(rotation_before, rotation_after) / (2 * step)
        np.testing.assert_allclose(paddle_jacobian(ARM, joints), numeric, atol=1e-8)


def test_quaternions_and_rotations_are_inverse_to_each_other(rng: np.random.Generator) -> None:
    for _ in range(200):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion) * np.sign(quaternion[3])
        np.testing.assert_allclose(
            quaternion_from_rotation(rotation_from_quaternion(quaternion)), quaternion, atol=1e-12
        )
    for axis in np.eye(3):
        half_turn = rotation_from_quaternion(np.array([*axis, 0.0]))
        np.testing.assert_allclose(np.abs(quaternion_from_rotation(half_turn))[:3], axis, atol=1e-12)


def test_turning_by_the_turn_between_arrives(rng: np.random.Generator) -> None:
    for _ in range(50):
        start = rotation_from_quaternion(rng.normal(size=4))
        goal = rotation_from_quaternion(rng.normal(size=4))
        np.testing.assert_allclose(turned(start, turn_between(start, goal)), goal, atol=1e-9)
    np.testing.assert_allclose(turned(start, np.zeros(3)), start, atol=1e-15)


def test_reach_pose_finds_reachable_poses_within_limits(rng: np.random.Generator) -> None:
    for _ in range(50):
        wanted = PLAYING_POSTURE + rng.normal(0.0, 0.25, 7)
        position, rotation = paddle_pose(ARM, wanted)
        found = reach_pose(ROBOT, position, rotation, PLAYING_POSTURE)
        reached, reached_rotation = paddle_pose(ARM, found.joint_position)
        np.testing.assert_allclose(reached, position, atol=1e-5)
        np.testing.assert_allclose(reached_rotation, rotation, atol=1e-5)
        assert found.distance_m < 1e-5
        assert found.angle_rad < 1e-5
        assert np.all(found.joint_position >= POSITION_LOWER_RAD)
        assert np.all(found.joint_position <= POSITION_UPPER_RAD)


def test_reach_blade_meets_centre_and_normal_and_leaves_the_handle_free(rng: np.random.Generator) -> None:
    closer = 0
    for _ in range(50):
        wanted = PLAYING_POSTURE + rng.normal(0.0, 0.25, 7)
        position, rotation = paddle_pose(ARM, wanted)
        found = reach_blade(ROBOT, position, rotation[:, 1], PLAYING_POSTURE)
        reached, reached_rotation = paddle_pose(ARM, found.joint_position)
        np.testing.assert_allclose(reached, position, atol=1e-5)
        np.testing.assert_allclose(reached_rotation[:, 1], rotation[:, 1], atol=1e-5)
        whole = reach_pose(ROBOT, position, rotation, PLAYING_POSTURE)
        closer += np.linalg.norm(found.joint_position - PLAYING_POSTURE) <= 1e-3 + np.linalg.norm(
            whole.joint_position - PLAYING_POSTURE
        )
    # One more degree of freedom lets the arm stay nearer to the posture that it likes.
    assert closer >= 45


def test_a_pose_out_of_reach_is_reported_not_raised() -> None:
    found = reach_pose(ROBOT, np.array([3.0, 0.0, 1.0]), np.eye(3), PLAYING_POSTURE)
    assert found.distance_m > 1.0
    assert np.all(np.isfinite(found.joint_position))


def test_joint_rates_give_the_twist_and_keep_to_the_posture(rng: np.random.Generator) -> None:
    jacobian = paddle_jacobian(ARM, PLAYING_POSTURE)
    twist = rng.normal(size=6) * 0.3
    rates = joint_rates_for_twist(jacobian, twist, np.zeros(7), 1e-6)
    np.testing.assert_allclose(jacobian @ rates, twist, atol=1e-6)
    preferred = rng.normal(size=7)
    with_posture = joint_rates_for_twist(jacobian, twist, preferred, 1e-6)
    np.testing.assert_allclose(jacobian @ with_posture, twist, atol=1e-6)
    assert np.linalg.norm(with_posture - preferred) < np.linalg.norm(rates - preferred)
