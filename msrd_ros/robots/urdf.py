"""The robot as URDF text, for Bullet and for the topic `robot_description` alike.

No meshes and no xacro: RViz, Foxglove and Bullet show it as it stands.
"""

from __future__ import annotations

from xml.etree import ElementTree

from msrd_ros.robots.sawyer import (
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    SPEED_LIMIT_RAD_S,
    TORQUE_LIMIT_NM,
)
from msrd_ros.robots.sawyer_description import (
    ARM_JOINTS,
    BASE_POSITION,
    BLADE_CENTRE_BEYOND_FLANGE_M,
    HEAD_JOINT,
    LINK_INERTIAS,
    JointOrigin,
    LinkInertia,
    paddle_inertia,
)
from msrd_ros.robots.shapes import COLOURS, LINK_SHAPES, Shape

WORLD_LINK = "world"
PADDLE_LINK = "paddle"

FIXED_JOINTS: tuple[JointOrigin, ...] = (
    JointOrigin("pedestal", WORLD_LINK, "right_arm_base_link", BASE_POSITION, (0.0, 0.0, 0.0)),
    HEAD_JOINT,
    JointOrigin(
        "right_paddle", "right_l6", PADDLE_LINK, (0.0, 0.0, BLADE_CENTRE_BEYOND_FLANGE_M), (0.0, 0.0, 0.0)
    ),
)
"""Frames that never move against their parent (for `/tf_static`)."""


def sawyer_urdf(mass_scale: float = 1.0) -> str:
    """URDF text of pedestal, arm, head and paddle; the root link is the frame `world`.

    Parameters
    ----------
    mass_scale
        Factor on all masses and inertias, for studies of how well a stroke bears an arm that is not
        quite the modelled one.
    """
    robot = ElementTree.Element("robot", name="sawyer")
    for name, colour in COLOURS.items():
        material = ElementTree.SubElement(robot, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=_numbers(colour))
    ElementTree.SubElement(robot, "link", name=WORLD_LINK)
    for inertia in (*LINK_INERTIAS, paddle_inertia()):
        _add_link(robot, inertia, mass_scale)
    for joint in FIXED_JOINTS:
        _add_joint(robot, joint, "fixed")
    for index, joint in enumerate(ARM_JOINTS):
        element = _add_joint(robot, joint, "revolute")
        ElementTree.SubElement(element, "axis", xyz="0 0 1")
        ElementTree.SubElement(
            element,
            "limit",
            lower=repr(float(POSITION_LOWER_RAD[index])),
            upper=repr(float(POSITION_UPPER_RAD[index])),
            velocity=repr(float(SPEED_LIMIT_RAD_S[index])),
            effort=repr(float(TORQUE_LIMIT_NM[index])),
        )
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _add_link(robot: ElementTree.Element, inertia: LinkInertia, mass_scale: float) -> None:
    link = ElementTree.SubElement(robot, "link", name=inertia.name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(inertia.centre), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=f"{inertia.mass * mass_scale:.9g}")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    moments = {name: f"{value * mass_scale:.9g}" for name, value in zip(names, inertia.inertia, strict=True)}
    ElementTree.SubElement(inertial, "inertia", moments)
    for shape in LINK_SHAPES[inertia.name]:
        visual = _add_shape(link, "visual", shape)
        ElementTree.SubElement(visual, "material", name=shape.colour)
    for shape in LINK_SHAPES[inertia.name]:
        if shape.solid:
            _add_shape(link, "collision", shape)


def _add_shape(link: ElementTree.Element, role: str, shape: Shape) -> ElementTree.Element:
    element = ElementTree.SubElement(link, role)
    ElementTree.SubElement(element, "origin", xyz=_numbers(shape.centre), rpy=_numbers(shape.roll_pitch_yaw))
    geometry = ElementTree.SubElement(element, "geometry")
    if shape.kind == "cylinder":
        sizes = {"radius": f"{shape.size[0]:.9g}", "length": f"{shape.size[1]:.9g}"}
    elif shape.kind == "sphere":
        sizes = {"radius": f"{shape.size[0]:.9g}"}
    else:
        sizes = {"size": _numbers(shape.size)}
    ElementTree.SubElement(geometry, shape.kind, sizes)
    return element


def _add_joint(robot: ElementTree.Element, joint: JointOrigin, kind: str) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=kind)
    ElementTree.SubElement(element, "origin", xyz=_numbers(joint.offset), rpy=_numbers(joint.roll_pitch_yaw))
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    return element
