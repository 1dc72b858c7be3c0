"""The arm as meshes: all that its description shows, where it is."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.core.paddle import BLADE_RADIUS_M
from msrd_ros.robots.kinematics import link_frames, paddle_pose
from msrd_ros.robots.loading import load_robot, shipped_robots
from msrd_ros.studio.outlines import arm_meshes


@pytest.mark.parametrize("name", shipped_robots())
def test_all_shapes_are_drawn(name: str) -> None:
    robot = load_robot(name)
    meshes = arm_meshes(robot)
    assert set(meshes) <= {"world", *robot.link_names}
    shapes = len(ElementTree.fromstring(robot.urdf).findall("link/visual"))
    assert sum(mesh.body_count for mesh in meshes.values()) >= shapes


@pytest.mark.parametrize("name", shipped_robots())
def test_the_paddle_hangs_where_it_is(name: str) -> None:
    robot = load_robot(name)
    positions, rotations = link_frames(robot.model, robot.home_rad)
    blade, _ = paddle_pose(robot.model, robot.home_rad)
    drawn = arm_meshes(robot)[robot.link_names[-1]].vertices @ rotations[-1].T + positions[-1]
    distances = np.linalg.norm(drawn - blade, axis=1)
    assert distances.min() < 1.1 * BLADE_RADIUS_M
    assert ((distances < 1.1 * BLADE_RADIUS_M).sum()) > 20


def test_a_shape_that_cannot_be_drawn_is_named() -> None:
    robot = load_robot("ur10e")
    standing = robot.standing
    root = ElementTree.fromstring(ElementTree.tostring(standing.arm.root))
    geometry = root.find("link[@name='forearm_link']/visual/geometry")
    assert geometry is not None
    geometry[0].tag = "mesh"
    arm = replace(standing.arm, root=root)
    broken = replace(robot, standing=replace(standing, arm=arm))
    with pytest.raises(UserError, match="robot ur10e: link forearm_link: a mesh cannot be drawn"):
        arm_meshes(broken)
