"""The robot's URDF, and the arm that Bullet makes of it against our own model."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest

from msrd_ros.robots.dynamics import inverse_dynamics, mass_matrix
from msrd_ros.robots.kinematics import link_frames, paddle_pose
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.table_tennis.simulation.bullet_arm import BulletArm
from sawyer import (
    ARM,
    JOINT_NAMES,
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    ROBOT,
    SPEED_LIMIT_RAD_S,
    TORQUE_LIMIT_NM,
)


@pytest.fixture(scope="module")
def robot() -> ElementTree.Element:
    return ElementTree.fromstring(ROBOT.urdf)


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=number)
    yield number
    pybullet.disconnect(number)


@pytest.fixture(scope="module")
def arm(client: int) -> BulletArm:
    return BulletArm(client, ROBOT)


def test_it_is_one_tree_under_the_world_frame(robot: ElementTree.Element) -> None:
    links = [link.attrib["name"] for link in robot.findall("link")]
    parents = [joint.find("parent").attrib["link"] for joint in robot.findall("joint")]  # type: ignore[union-attr]
    children = [joint.find("child").attrib["link"] for joint in robot.findall("joint")]  # type: ignore[union-attr]
    assert len(set(links)) == len(links)
    assert len(set(children)) == len(children)
    assert set(parents) <= set(links)
    assert set(links) - set(children) == {"world"}


def test_it_needs_no_files_and_defines_its_materials(robot: ElementTree.Element) -> None:
    assert robot.find(".//mesh") is None
    assert "package://" not in ROBOT.urdf
    defined = {material.attrib["name"] for material in robot.findall("material")}
    used = {material.attrib["name"] for material in robot.findall("link/visual/material")}
    assert used <= defined


def test_joints_carry_the_published_limits(robot: ElementTree.Element) -> None:
    joints = {joint.attrib["name"]: joint for joint in robot.findall("joint[@type='revolute']")}
    assert tuple(joints) == JOINT_NAMES
    for index, joint in enumerate(joints.values()):
        limit = joint.find("limit")
        assert limit is not None
        assert float(limit.attrib["lower"]) == POSITION_LOWER_RAD[index]
        assert float(limit.attrib["upper"]) == POSITION_UPPER_RAD[index]
        assert float(limit.attrib["velocity"]) == SPEED_LIMIT_RAD_S[index]
        assert float(limit.attrib["effort"]) == TORQUE_LIMIT_NM[index]


def test_mass_scale_scales_every_mass_and_inertia() -> None:
    for tag, key in (("mass", "value"), ("inertia", "ixx")):
        plain, heavy = (
            [float(part.attrib[key]) for part in ElementTree.fromstring(text).iter(tag)]
            for text in (ROBOT.urdf, ROBOT.standing.text(1.1))
        )
        np.testing.assert_allclose(heavy, np.array(plain) * 1.1, rtol=1e-8)


def test_bullet_puts_links_and_paddle_where_our_kinematics_do(client: int, arm: BulletArm) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        joints = rng.uniform(POSITION_LOWER_RAD, POSITION_UPPER_RAD)
        arm.place(joints)
        origins, rotations = link_frames(ARM, joints)
        poses = dict(zip(ROBOT.link_names, zip(origins, rotations, strict=True), strict=True))
        poses["paddle"] = paddle_pose(ARM, joints)
        joint_of = dict(zip(ROBOT.link_names, JOINT_NAMES, strict=True)) | {"paddle": "paddle_mount"}
        for name, (position, rotation) in poses.items():
            state = pybullet.getLinkState(
                arm.body, arm.links[joint_of[name]], computeForwardKinematics=1, physicsClientId=client
            )
            np.testing.assert_allclose(state[4], position, atol=2e-6)
            overlap = abs(np.dot(state[5], quaternion_from_rotation(rotation)))
            assert overlap == pytest.approx(1.0, abs=1e-6)


def test_bullet_needs_the_torques_that_our_dynamics_say(client: int, arm: BulletArm) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        joints = rng.uniform(POSITION_LOWER_RAD, POSITION_UPPER_RAD)
        velocity, acceleration = rng.normal(size=7), rng.normal(size=7) * 10.0
        torque = pybullet.calculateInverseDynamics(
            arm.body, joints.tolist(), velocity.tolist(), acceleration.tolist(), physicsClientId=client
        )
        np.testing.assert_allclose(inverse_dynamics(ARM, joints, velocity, acceleration), torque, atol=1e-5)
        matrix = pybullet.calculateMassMatrix(arm.body, joints.tolist(), physicsClientId=client)
        np.testing.assert_allclose(mass_matrix(ARM, joints), matrix, atol=1e-6)
