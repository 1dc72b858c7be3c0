"""Any serial arm becomes a chain: Bullet, from the URDF alone, puts it there too and with the same forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pybullet
import pytest

from made_up_robot import ANGLE_RAD, made_up_robot
from msrd_ros.robots.dynamics import inverse_dynamics, mass_matrix
from msrd_ros.robots.kinematics import link_frames, paddle_jacobian, paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import rotation_from_quaternion
from msrd_ros.table_tennis.simulation.bullet_arm import BulletArm


class Twins(NamedTuple):
    """An arm as ours and as Bullet's."""

    client: int
    robot: Robot
    bullet: BulletArm

    def pose(self, link: int) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation of a link's frame, as Bullet sees it."""
        state = pybullet.getLinkState(
            self.bullet.body, link, computeForwardKinematics=1, physicsClientId=self.client
        )
        return np.array(state[4]), rotation_from_quaternion(np.array(state[5]))


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=number)
    yield number
    pybullet.disconnect(number)


@pytest.fixture(scope="module", params=[(3, 1), (6, 2), (6, 3)], ids=lambda param: f"{param[0]}-{param[1]}")
def twins(request: pytest.FixtureRequest, client: int, tmp_path_factory: pytest.TempPathFactory) -> Twins:
    joints, seed = request.param
    robot = made_up_robot(
        tmp_path_factory.mktemp("robots") / f"arm_{seed}", joints, np.random.default_rng(seed)
    )
    return Twins(client, robot, BulletArm(client, robot))


@pytest.fixture
def postures(twins: Twins) -> np.ndarray:
    return np.random.default_rng(4).uniform(-ANGLE_RAD, ANGLE_RAD, (20, twins.robot.joint_count))


def test_joints_and_paddle_are_where_bullet_puts_them(twins: Twins, postures: np.ndarray) -> None:
    robot = twins.robot
    for joints in postures:
        twins.bullet.place(joints)
        origins, rotations = link_frames(robot.model, joints)
        for index, name in enumerate(robot.joint_names):
            position, rotation = twins.pose(twins.bullet.links[name])
            np.testing.assert_allclose(origins[index], position, atol=5e-6)
            # Our frames turn about their own z, whatever the axis in the URDF is.
            axis = np.array(robot.standing.arm.joints[name].axis)
            np.testing.assert_allclose(
                rotations[index, :, 2], rotation @ axis / np.linalg.norm(axis), atol=5e-6
            )
        position, rotation = twins.pose(twins.bullet.links["paddle_mount"])
        ours, turn = paddle_pose(robot.model, joints)
        np.testing.assert_allclose(ours, position, atol=5e-6)
        np.testing.assert_allclose(turn, rotation, atol=5e-6)


def test_spheres_are_on_the_links_that_are_named(twins: Twins, postures: np.ndarray) -> None:
    model = twins.robot.model[0]
    for joints in postures:
        twins.bullet.place(joints)
        origins, rotations = link_frames(twins.robot.model, joints)
        position, rotation = twins.pose(twins.bullet.links["to_bracket_1"])
        link = model["sphere_links"][0]
        np.testing.assert_allclose(
            origins[link] + rotations[link] @ model["sphere_centres"][0],
            position + rotation @ np.array([0.01, 0.02, 0.03]),
            atol=5e-6,
        )


def test_the_jacobian_moves_the_paddle(twins: Twins, postures: np.ndarray) -> None:
    step = 1e-6
    for joints in postures:
        jacobian = paddle_jacobian(twins.robot.model, joints)
        for index in range(twins.robot.joint_count):
            shift = np.zeros(twins.robot.joint_count)
            shift[index] = step
            after, _ = paddle_pose(twins.robot.model, joints + shift)
            before, _ = paddle_pose(twins.robot.model, joints - shift)
            np.testing.assert_allclose(jacobian[:3, index], (after - before) / (2 * step), atol=1e-8)


def test_forces_are_those_of_bullet(twins: Twins, postures: np.ndarray) -> None:
    rng = np.random.default_rng(5)
    for joints in postures:
        velocity, acceleration = rng.normal(size=joints.shape), 10.0 * rng.normal(size=joints.shape)
        torque = pybullet.calculateInverseDynamics(
            twins.bullet.body,
            joints.tolist(),
            velocity.tolist(),
            acceleration.tolist(),
            physicsClientId=twins.client,
        )
        ours = inverse_dynamics(twins.robot.model, joints, velocity, acceleration)
        np.testing.assert_allclose(ours, torque, rtol=1e-5, atol=1e-3)
        matrix = pybullet.calculateMassMatrix(
            twins.bullet.body, joints.tolist(), physicsClientId=twins.client
        )
        np.testing.assert_allclose(mass_matrix(twins.robot.model, joints), matrix, rtol=1e-5, atol=1e-4)
