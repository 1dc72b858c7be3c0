"""Forward kinematics for all postures: Bullet, from the URDF alone, puts every link in the same place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pybullet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.robots.kinematics import link_frames, paddle_pose
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.robots.sawyer import JOINT_NAMES, POSITION_LOWER_RAD, POSITION_UPPER_RAD
from msrd_ros.table_tennis.simulation.bullet_arm import BulletArm

POSTURES = st.tuples(
    *(
        st.floats(float(low), float(high))
        for low, high in zip(POSITION_LOWER_RAD, POSITION_UPPER_RAD, strict=True)
    )
)


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


@pytest.fixture(scope="module")
def arm(client: int) -> BulletArm:
    return BulletArm(client)


@given(posture=POSTURES)
def test_bullet_agrees(client: int, arm: BulletArm, posture: tuple[float, ...]) -> None:
    joints = np.array(posture)
    arm.place(joints)
    origins, rotations = link_frames(joints)
    paddle, blade = paddle_pose(joints)
    frames = [*zip(JOINT_NAMES, origins, rotations, strict=True), ("right_paddle", paddle, blade)]
    for name, position, rotation in frames:
        state = pybullet.getLinkState(
            arm.body, arm.links[name], computeForwardKinematics=1, physicsClientId=client
        )
        np.testing.assert_allclose(state[4], position, atol=3e-6)
        assert abs(np.dot(state[5], quaternion_from_rotation(rotation))) == pytest.approx(1.0, abs=1e-6)
