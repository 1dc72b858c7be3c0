"""A robot is read from its folder, and a broken description is refused with file, key and what to write."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from msrd_ros.core.errors import UserError
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import (
    default_robot,
    load_robot,
    robots_directory,
    shipped_robots,
)

SHEET, DESCRIPTION = "robot.yaml", "robot.urdf"

Values = dict[str, Any]
Tree = ElementTree.Element


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The Sawyer's folder as somebody else's, to be broken."""
    return Path(shutil.copytree(robots_directory() / DEFAULT_ROBOT, tmp_path / "mine"))


def rewrite_sheet(folder: Path, change: Callable[[Values], object]) -> None:
    path = folder / SHEET
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(values)
    path.write_text(yaml.safe_dump(values), encoding="utf-8")


def rewrite_description(folder: Path, change: Callable[[Tree], object]) -> None:
    tree = ElementTree.parse(folder / DESCRIPTION)
    change(tree.getroot())
    tree.write(folder / DESCRIPTION)


def holder(values: Values, key: str) -> tuple[Any, Any]:
    """What holds a dotted key, and its last part; a number in the key is an index into a list."""
    *outer, last = (int(part) if part.isdigit() else part for part in key.split("."))
    inner: Any = values
    for part in outer:
        inner = inner[part]
    return inner, last


def put(key: str, value: object) -> Callable[[Values], None]:
    """Write `value` under a dotted key."""

    def change(values: Values) -> None:
        inner, last = holder(values, key)
        inner[last] = value

    return change


def drop(key: str) -> Callable[[Values], None]:
    """Remove a dotted key."""

    def change(values: Values) -> None:
        inner, last = holder(values, key)
        del inner[last]

    return change


def element(root: Tree, path: str) -> Tree:
    found = root.find(path)
    assert found is not None
    return found


def attribute(path: str, key: str, value: str) -> Callable[[Tree], None]:
    """Set an attribute of an element of the URDF."""
    return lambda root: element(root, path).set(key, value)


def without_joint(name: str) -> Callable[[Tree], None]:
    return lambda root: root.remove(element(root, f"joint[@name='{name}']"))


def refusal(folder: Path) -> str:
    with pytest.raises(UserError) as caught:
        load_robot(folder)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_the_default_robot_ships_with_the_package() -> None:
    assert DEFAULT_ROBOT in shipped_robots()
    assert load_robot(DEFAULT_ROBOT) == default_robot()


@pytest.mark.parametrize("name", shipped_robots())
def test_a_shipped_robot_is_called_as_its_folder_and_starts_within_its_limits(name: str) -> None:
    robot = load_robot(name)
    assert robot.name == name
    assert robot.model[0]["speed"].shape == (robot.joint_count,)
    assert np.all(robot.home_rad >= robot.limits.lowest_rad)
    assert np.all(robot.home_rad <= robot.limits.highest_rad)


def test_a_folder_is_as_good_as_a_name(folder: Path) -> None:
    mine, shipped = load_robot(folder), default_robot()
    assert mine == shipped
    assert mine.folder == folder.resolve()
    assert mine.model.tobytes() == shipped.model.tobytes()


def test_a_sheet_may_say_its_format(folder: Path) -> None:
    rewrite_sheet(folder, put("format", 1))
    assert load_robot(folder) == default_robot()


@pytest.mark.parametrize("key", ["position_upper_rad", "speed_rad_s"])
def test_narrower_limits_make_another_robot_of_the_same_name(folder: Path, key: str) -> None:
    rewrite_sheet(folder, put(f"limits.{key}.5", 2.9))
    assert load_robot(folder).digest != default_robot().digest
    assert load_robot(folder) != default_robot()


def test_a_name_that_nobody_has_lists_those_that_there_are() -> None:
    with pytest.raises(UserError, match="robot 'panda'") as caught:
        load_robot("panda")
    for name in shipped_robots():
        assert name in str(caught.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (drop("home_rad"), ["home_rad is missing", "7 numbers"]),
        (drop("limits.speed_rad_s"), ["limits.speed_rad_s is missing", "7 numbers"]),
        (drop("paddle.link"), ["paddle.link is missing", "write a name"]),
        (drop("keep_out"), ["keep_out is missing", "write a list"]),
        (drop("limits.torque_nm.6"), ["limits.torque_nm", "6 numbers for 7 joints", "right_j6"]),
        (put("home_rad", [0.0] * 8), ["home_rad has 8 numbers for 7 joints"]),
        (put("base.position_m", [0.0, 1.0]), ["base.position_m has 2 numbers", "write three"]),
        (put("home_rad", 0.5), ["home_rad is 0.5", "write a list"]),
        (put("limits.speed_rad_s.3", float("inf")), ["limits.speed_rad_s of joint right_j3", "finite"]),
        (
            put("limits.position_lower_rad.0", float("nan")),
            ["limits.position_lower_rad of joint right_j0", "finite"],
        ),
        (put("limits.acceleration_rad_s2.1", "fast"), ["limits.acceleration_rad_s2 of joint right_j1"]),
        (put("limits.torque_nm.2", True), ["limits.torque_nm of joint right_j2 is True"]),
        (put("limits.speed_rad_s.4", -1.0), ["limits.speed_rad_s of joint right_j4", "at least 0"]),
        (put("limits.speed_rad_s.4", 0.0), ["limits.speed_rad_s of joint right_j4 is 0"]),
        (
            lambda values: values["limits"].update(
                position_lower_rad=values["limits"]["position_upper_rad"],
                position_upper_rad=values["limits"]["position_lower_rad"],
            ),
            ["joint right_j0", "position_lower_rad", "write the lower one first"],
        ),
        (
            put("limits.position_upper_rad.5", 3.1),
            ["limits.position_upper_rad of joint right_j5 is 3.1, wider than upper", DESCRIPTION],
        ),
        (
            put("limits.position_lower_rad.5", -3.1),
            ["limits.position_lower_rad of joint right_j5 is -3.1, wider than lower"],
        ),
        (put("limits.speed_rad_s.0", 9.0), ["limits.speed_rad_s of joint right_j0", "wider than velocity"]),
        (put("limits.torque_nm.0", 900.0), ["limits.torque_nm of joint right_j0", "wider than effort"]),
        (put("home_rad.1", 2.27), ["home_rad of joint right_j1 is 2.27", "write an angle from"]),
        (put("planning.hit_upper_rad.0", -1.3), ["planning", "joint right_j0", "lower one first"]),
        (put("planning.rest_lower_rad.2", 3.0), ["planning", "joint right_j2", "lower one first"]),
        (put("teaching.brake_from", 0.99), ["teaching.brake_from is 0.99", "0.98"]),
        (put("planning.hit_upper_rad.0", 3.2), ["planning.hit_upper_rad of joint right_j0 is 3.2"]),
        (put("joints", []), ["joints is []", "list each joint once"]),
        (put("joints.6", "right_j5"), ["joints is", "list each joint once"]),
        (put("lift.joint", "elbow"), ["lift.joint is elbow", "right_j1"]),
        (put("keep_out.0.link", "elbow"), ["keep_out[0]", "no link 'elbow'", "right_l2"]),
        (put("keep_out.0.radius", 0.1), ["keep_out[0]", "radius is unknown"]),
        (put("keep_out.0", "right_l2"), ["keep_out[0]", "link is missing"]),
        (drop("keep_out.3.radius_m"), ["keep_out[3]", "radius_m is missing"]),
        (put("teaching.brake_full", 1.5), ["teaching.brake_full is 1.5", "from 0 to 1"]),
        (put("format", 2), ["is of format 2", "upgrade msrd_ros"]),
        (put("format", "new"), ["format 'new' is no version"]),
        (put("colour", "red"), ["colour is unknown", "home_rad"]),
        (put("limits.jerk_rad_s3", [1.0] * 7), ["limits.jerk_rad_s3 is unknown", "limits.speed_rad_s"]),
        (
            put("base.position_m", [-4.5, 0.0, 0.91]),
            ["base.position_m", "the end of the table", "put the base nearer"],
        ),
    ],
)
def test_a_broken_sheet_is_refused(folder: Path, change: Callable[[Values], object], says: list[str]) -> None:
    rewrite_sheet(folder, change)
    message = refusal(folder)
    for part in (str(folder / SHEET), *says):
        assert part in message


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (without_joint("right_j3"), ["joint right_j3 is missing", "right_j4"]),
        (
            attribute("joint[@name='right_j3']", "name", "elbow"),
            ["joint right_j3 is missing", "add it", "elbow"],
        ),
        (attribute("joint[@name='right_j3']", "type", "prismatic"), ["right_j3 is prismatic", "revolute"]),
        (
            attribute("joint[@name='right_j3']/axis", "xyz", "0 0 0"),
            ["joint right_j3", "axis", "unit vector"],
        ),
        (attribute("joint[@name='right_j3']/axis", "xyz", "0 1"), ["joint right_j3", "write three numbers"]),
        (attribute("joint[@name='right_j3']/origin", "xyz", "a b c"), ["joint right_j3", "three numbers"]),
        (attribute("joint[@name='right_j3']/limit", "upper", "far"), ["joint right_j3", "'far'", "a number"]),
        (attribute("joint[@name='right_j3']/limit", "upper", "nan"), ["joint right_j3", "'nan'", "a number"]),
        (attribute("joint[@name='right_j3']/child", "link", "arm"), ["joint right_j3", "child link 'arm'"]),
        (
            attribute("link[@name='right_l3']/inertial/mass", "value", "-1"),
            ["link right_l3", "negative mass"],
        ),
        (
            attribute("link[@name='right_l3']/inertial/mass", "value", "kg"),
            ["link right_l3", "value is 'kg'"],
        ),
    ],
)
def test_a_broken_description_is_refused(
    folder: Path, change: Callable[[Tree], object], says: list[str]
) -> None:
    rewrite_description(folder, change)
    message = refusal(folder)
    for part in (str(folder / DESCRIPTION), *says):
        assert part in message


@pytest.mark.parametrize(
    ("path", "key", "value"),
    [
        ("joint[@name='right_j3']/origin", "xyz", "0 nan 0"),
        ("joint[@name='right_j3']/origin", "rpy", "inf 0 0"),
        ("link[@name='right_l3']/inertial/mass", "value", "inf"),
        ("link[@name='right_l3']/inertial/inertia", "ixx", "nan"),
    ],
)
def test_a_number_of_the_description_that_is_not_finite_is_refused(
    folder: Path, path: str, key: str, value: str
) -> None:
    rewrite_description(folder, attribute(path, key, value))
    message = refusal(folder)
    assert str(folder / DESCRIPTION) in message
    assert "right_j3" in message or "right_l3" in message
    assert key in message


def test_a_chain_that_ends_before_the_paddle_is_refused(folder: Path) -> None:
    rewrite_sheet(folder, put("paddle.link", "right_l4"))
    message = refusal(folder)
    assert str(folder / DESCRIPTION) in message
    assert "to the paddle's link right_l4 are right_j0, right_j1, right_j2, right_j3, right_j4" in message
    assert "list just these, in this order, in `joints`" in message


def test_a_paddle_on_no_link_is_refused(folder: Path) -> None:
    rewrite_sheet(folder, put("paddle.link", "right_hand_2"))
    message = refusal(folder)
    assert "no link 'right_hand_2' for the paddle; set paddle.link to one of" in message
    assert "right_l6" in message


def test_joints_in_another_order_are_refused(folder: Path) -> None:
    def swap(values: Values) -> None:
        joints = values["joints"]
        joints[4], joints[5] = joints[5], joints[4]

    rewrite_sheet(folder, swap)
    assert "list just these, in this order, in `joints`" in refusal(folder)


def test_a_moving_joint_that_is_not_listed_is_refused(folder: Path) -> None:
    def forget(values: Values) -> None:
        values["joints"].remove("right_j6")
        for table, keys in (("limits", values["limits"]), ("planning", values["planning"])):
            for key, numbers in keys.items():
                if isinstance(numbers, list):
                    values[table][key] = numbers[:6]
        values["home_rad"] = values["home_rad"][:6]
        values["driver"]["friction_nm_s"] = values["driver"]["friction_nm_s"][:6]
        values["teaching"]["joint_damping_nm_s"] = values["teaching"]["joint_damping_nm_s"][:6]

    rewrite_sheet(folder, forget)
    message = refusal(folder)
    assert "joint right_j6 is between base and paddle and not listed" in message
    assert "add it to `joints`, or make it fixed" in message


def test_links_that_carry_each_other_are_refused(folder: Path) -> None:
    def ring(root: Tree) -> None:
        for name in ("cog", "wheel"):
            ElementTree.SubElement(root, "link", name=name)
        for parent, child in (("cog", "wheel"), ("wheel", "cog")):
            joint = ElementTree.SubElement(root, "joint", name=f"{parent}_{child}", type="fixed")
            ElementTree.SubElement(joint, "parent", link=parent)
            ElementTree.SubElement(joint, "child", link=child)

    rewrite_description(folder, ring)
    message = refusal(folder)
    assert str(folder / DESCRIPTION) in message
    assert "cog" in message


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        (SHEET, "joints: [a, b", "is not YAML"),
        (SHEET, "- a\n- b\n", "holds no keys"),
        (SHEET, "", "holds no keys"),
        (DESCRIPTION, "<robot name='sawyer'>", "is not XML"),
        (DESCRIPTION, "", "is not XML"),
        (DESCRIPTION, "<xacro/>", "a URDF begins with <robot>"),
    ],
)
def test_a_file_of_another_kind_is_refused(folder: Path, file: str, text: str, says: str) -> None:
    (folder / file).write_text(text, encoding="utf-8")
    message = refusal(folder)
    assert str(folder / file) in message
    assert says in message


def test_a_missing_description_is_refused(folder: Path) -> None:
    (folder / DESCRIPTION).unlink()
    message = refusal(folder)
    assert f"{folder / DESCRIPTION}: cannot be read" in message
    assert "put the robot's URDF there" in message


def test_a_folder_without_a_sheet_is_no_robot(folder: Path) -> None:
    (folder / SHEET).unlink()
    assert f"no folder with {SHEET}" in refusal(folder)


def test_a_change_of_either_file_is_seen(folder: Path) -> None:
    before = load_robot(folder)
    rewrite_description(folder, attribute("link[@name='right_l3']/inertial/mass", "value", "9.0"))
    after = load_robot(folder)
    assert after.model[0]["masses"][3] == 9.0
    assert before.model[0]["masses"][3] != 9.0


def test_a_robot_refuses_what_belongs_to_another() -> None:
    robot = default_robot()
    robot.require(robot.name, "bag b")
    robot.require(robot.identity, "bag b")
    with pytest.raises(UserError, match=r"bag b: is of the robot panda, not sawyer; say robot:=panda"):
        robot.require("panda@0123", "bag b")


def test_a_robot_refuses_what_belongs_to_a_namesake_with_other_limits(folder: Path) -> None:
    rewrite_sheet(folder, put("limits.speed_rad_s.0", 1.0))
    with pytest.raises(UserError, match=r"bag b: is of a robot sawyer with other joints or limits") as caught:
        load_robot(folder).require(default_robot().identity, "bag b")
    assert str(folder) in str(caught.value)
