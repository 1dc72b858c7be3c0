"""Arms that nobody has built: joints about any axis, fixed links in between, a base that stands askew."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import yaml
from numpy.typing import NDArray

from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot

AXES = ("1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1", "0.6 0 0.8", "1 1 1")
ANGLE_RAD = 3.0
LIMIT = {"lower": -ANGLE_RAD, "upper": ANGLE_RAD, "velocity": 3.0, "effort": 80.0}


def made_up_robot(folder: Path, joints: int, rng: np.random.Generator) -> Robot:
    """An arm with a fixed link behind every second joint, another aside on each link, and a tool in its hand.

    Parameters
    ----------
    folder
        Filled with its description.
    joints
        How many, N.
    rng
        Decides on everything else.
    """
    root = ElementTree.Element("robot", name="made_up")
    link = _add_link(root, "stand", rng)
    # Neither the stand's own offset nor a turn of it may get lost.
    link = _add_joint(root, link, _add_link(root, "column", rng), "fixed", rng)
    for index in range(joints):
        link = _add_joint(root, link, _add_link(root, f"link_{index}", rng), f"joint_{index}", rng)
        _add_joint(root, link, _add_link(root, f"cover_{index}", rng), "fixed", rng)
        if index % 2:
            link = _add_joint(root, link, _add_link(root, f"bracket_{index}", rng), "fixed", rng)
    _add_joint(root, link, _add_link(root, "tool", None), "fixed", rng)
    # No order of the elements may matter.
    root[:] = [root[index] for index in rng.permutation(len(root))]
    folder.mkdir(parents=True)
    ElementTree.ElementTree(root).write(folder / "robot.urdf")
    (folder / "robot.yaml").write_text(yaml.safe_dump(_sheet(joints, rng)), encoding="utf-8")
    return load_robot(folder)


def _sheet(joints: int, rng: np.random.Generator) -> dict[str, object]:
    def each(value: float) -> list[float]:
        return [value] * joints

    def pose(position: NDArray[np.float64]) -> dict[str, list[float]]:
        return {"position_m": position.tolist(), "roll_pitch_yaw_rad": rng.uniform(-3.0, 3.0, 3).tolist()}

    return {
        "name": "made_up",
        "joints": [f"joint_{index}" for index in range(joints)],
        "base": pose(np.array([-1.6, 0.0, 0.9])),
        "paddle": {"link": "tool", **pose(rng.uniform(-0.2, 0.2, 3))},
        "limits": {
            "position_lower_rad": each(-ANGLE_RAD),
            "position_upper_rad": each(ANGLE_RAD),
            "position_margin_rad": 0.01,
            "speed_rad_s": each(3.0),
            "acceleration_rad_s2": each(20.0),
            "torque_nm": each(80.0),
        },
        "home_rad": each(0.1),
        "driver": {
            "friction_nm_s": each(1.0),
            "stiffness_1_s2": 10_000.0,
            "damping_1_s": 200.0,
            "catch_up_1_s": 50.0,
        },
        "teaching": {"joint_damping_nm_s": each(1.0), "brake_from": 0.9, "brake_full": 0.98},
        "keep_out": [{"link": "bracket_1", "centre_m": [0.01, 0.02, 0.03], "radius_m": 0.05}],
        "lift": {"joint": "joint_0", "direction": 1.0},
        "planning": {
            "hit_lower_rad": each(-2.0),
            "hit_upper_rad": each(2.0),
            "rest_lower_rad": each(-2.0),
            "rest_upper_rad": each(2.0),
            "middle_rad": each(0.0),
        },
    }


def _text(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _pose(element: ElementTree.Element, rng: np.random.Generator) -> None:
    turn = rng.choice([-np.pi / 2, 0.0, 0.4, np.pi / 2], 3)
    ElementTree.SubElement(element, "origin", xyz=_text(rng.uniform(-0.3, 0.3, 3)), rpy=_text(turn))


def _add_link(root: ElementTree.Element, name: str, rng: np.random.Generator | None) -> str:
    """A link that weighs something, or nothing without `rng`."""
    link = ElementTree.SubElement(root, "link", name=name)
    if rng is not None:
        inertial = ElementTree.SubElement(link, "inertial")
        _pose(inertial, rng)
        ElementTree.SubElement(inertial, "mass", value=repr(float(rng.uniform(0.5, 3.0))))
        # Of a cloud of points, so that no moment is larger than the sum of the other two.
        points = rng.normal(0.0, 0.1, (8, 3))
        tensor = np.einsum("pi,pi->", points, points) * np.eye(3) - points.T @ points
        keys = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
        ElementTree.SubElement(
            inertial, "inertia", {key: repr(float(tensor[place])) for key, place in keys.items()}
        )
    return name


def _add_joint(
    root: ElementTree.Element, parent: str, child: str, name: str, rng: np.random.Generator
) -> str:
    """A joint, fixed if it is called so; returns its child."""
    fixed = name == "fixed"
    joint = ElementTree.SubElement(
        root,
        "joint",
        name=f"to_{child}" if fixed else name,
        type="fixed" if fixed else "revolute",
    )
    _pose(joint, rng)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    if not fixed:
        ElementTree.SubElement(joint, "axis", xyz=str(rng.choice(AXES)))
        ElementTree.SubElement(joint, "limit", {key: repr(value) for key, value in LIMIT.items()})
    return child
