"""Reading a robot description (URDF), and writing the one that Bullet and `robot_description` get.

Of a URDF only links with their inertias and joints with their origins, axes and limits matter here; shapes
are handed on as they stand. No meshes and no xacro: RViz, Foxglove and Bullet show it as it stands.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from msrd_ros.core.errors import UserError

Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)

WORLD_LINK = "world"
PADDLE_LINK = "paddle"
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


class LinkInertia(NamedTuple):
    """Mass (kg), centre of mass (m, link frame) and inertia ixx, ixy, ixz, iyy, iyz, izz (kg m^2).

    The inertia is about the centre of mass, with axes turned by `roll_pitch_yaw` in rad.
    """

    name: str
    mass: float
    centre: Vector
    inertia: tuple[float, float, float, float, float, float]
    roll_pitch_yaw: Vector = ORIGIN


class JointOrigin(NamedTuple):
    """Where a joint sits on its parent link: offset in m and fixed-axis roll, pitch, yaw in rad."""

    name: str
    parent: str
    child: str
    offset: Vector
    roll_pitch_yaw: Vector
    kind: str = "fixed"
    axis: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Description:
    """What a URDF says.

    Attributes
    ----------
    path
        Of the file, for errors.
    root
        Its XML.
    links, joints
        By name, in the file's order.
    """

    path: Path
    root: ElementTree.Element
    links: dict[str, LinkInertia]
    joints: dict[str, JointOrigin]

    @property
    def root_link(self) -> str:
        """The link that no joint carries."""
        carried = {joint.child for joint in self.joints.values()}
        roots = [name for name in self.links if name not in carried]
        if len(roots) != 1:
            raise UserError(
                f"{self.path}: {len(roots)} links have no parent ({', '.join(roots) or 'none'}); "
                "join all links into one tree"
            )
        return roots[0]

    def require_tree(self) -> None:
        """Refuse links that do not hang, by one joint each, on the root.

        Raises
        ------
        UserError
            If there is one; names it.
        """
        children = [joint.child for joint in self.joints.values()]
        reached, waiting = {self.root_link}, [self.root_link]
        while waiting:
            parent = waiting.pop()
            found = [joint.child for joint in self.joints.values() if joint.parent == parent]
            reached.update(found)
            waiting.extend(child for child in found if children.count(child) == 1)
        for link in self.links:
            if children.count(link) > 1:
                raise UserError(f"{self.path}: link {link} is the child of several joints; leave one")
            if link not in reached:
                raise UserError(f"{self.path}: link {link} hangs on itself; join all links into one tree")

    def carrier(self, link: str) -> JointOrigin | None:
        """The joint that carries a link; None for the root."""
        return next((joint for joint in self.joints.values() if joint.child == link), None)


def read_urdf(path: Path) -> Description:
    """Read a robot description.

    Raises
    ------
    UserError
        If it cannot be read, or a number in it is not one; names the file and the link or joint.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); put the robot's URDF there") from None
    except ElementTree.ParseError as error:
        raise UserError(f"{path}: is not XML ({error}); export the URDF again") from None
    if root.tag != "robot":
        raise UserError(f"{path}: begins with <{root.tag}>; a URDF begins with <robot> (run xacro first)")
    links = {link.get("name", ""): _inertia(link, path) for link in root.findall("link")}
    joints = {joint.get("name", ""): _joint(joint, links, path) for joint in root.findall("joint")}
    return Description(path, root, links, joints)


def _inertia(link: ElementTree.Element, path: Path) -> LinkInertia:
    name = link.get("name", "")
    inertial = link.find("inertial")
    if inertial is None:
        return LinkInertia(name, 0.0, ORIGIN, (0.0,) * 6)
    where = f"{path}: link {name}"
    centre, turn = read_pose(inertial, where)
    mass = _number(inertial.find("mass"), "value", where)
    tensor = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (_number(tensor, key, where) for key in _TENSOR)
    if mass < 0.0 or min(xx, yy, zz) < 0.0:
        raise UserError(f"{where}: has a negative mass or moment of inertia; correct its <inertial>")
    return LinkInertia(name, mass, centre, (xx, xy, xz, yy, yz, zz), turn)


def _joint(joint: ElementTree.Element, links: dict[str, LinkInertia], path: Path) -> JointOrigin:
    name = joint.get("name", "")
    where = f"{path}: joint {name}"
    ends = []
    for role in ("parent", "child"):
        element = joint.find(role)
        link = "" if element is None else element.get("link", "")
        if link not in links:
            raise UserError(f"{where}: its {role} link {link!r} is not in the file; add the link")
        ends.append(link)
    offset, turn = read_pose(joint, where)
    axis_element = joint.find("axis")
    axis = (1.0, 0.0, 0.0) if axis_element is None else _vector(axis_element, "xyz", where)
    return JointOrigin(name, ends[0], ends[1], offset, turn, joint.get("type", ""), axis)


def read_pose(element: ElementTree.Element, where: str) -> tuple[Vector, Vector]:
    """Offset in m and fixed-axis roll, pitch, yaw in rad of what has an ``<origin>``; zeros without one.

    Raises
    ------
    UserError
        If they are not three numbers each; names `where`.
    """
    origin = element.find("origin")
    if origin is None:
        return ORIGIN, ORIGIN
    return _vector(origin, "xyz", where), _vector(origin, "rpy", where)


def _vector(element: ElementTree.Element, key: str, where: str) -> Vector:
    words = element.get(key, "0 0 0").split()
    try:
        x, y, z = (_finite(word) for word in words)
    except ValueError:
        raise UserError(f"{where}: {key}={' '.join(words)!r}; write three numbers") from None
    return x, y, z


def _number(element: ElementTree.Element | None, key: str, where: str) -> float:
    text = None if element is None else element.get(key)
    try:
        return _finite(text or "")
    except ValueError:
        raise UserError(f"{where}: {key} is {text!r}; write a number") from None


def _finite(text: str) -> float:
    """A number; `ValueError` for none, and for one that is not finite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


@dataclass(frozen=True)
class StandingArm:
    """An arm where it stands, with the paddle in its hand: what is written as one description.

    Attributes
    ----------
    arm, paddle
        Descriptions of both.
    base
        Position and roll, pitch, yaw of the arm's root link in `world`.
    mount
        Where the paddle sits.
    limits
        By joint: lower, upper, velocity, effort.
    """

    arm: Description
    paddle: Description
    base: tuple[Vector, Vector]
    mount: JointOrigin
    limits: dict[str, dict[str, float]]

    @property
    def fixed_joints(self) -> tuple[JointOrigin, ...]:
        """Joints that never move: the stand, those of the arm, the paddle's mount."""
        stand = JointOrigin("pedestal", WORLD_LINK, self.arm.root_link, *self.base)
        own = [joint for joint in self.arm.joints.values() if joint.name not in self.limits]
        return stand, *own, self.mount

    def text(self, mass_scale: float = 1.0) -> str:
        """URDF whose root link is the frame `world`.

        Parameters
        ----------
        mass_scale
            Factor on all masses and inertias, for studies of how well a stroke bears an arm that is not
            quite the modelled one.
        """
        robot = ElementTree.Element("robot", name=self.arm.root.get("name", "robot"))
        parts = (self.arm.root, self.paddle.root)
        for part in parts:
            robot.extend(copy.deepcopy(part.findall("material")))
        ElementTree.SubElement(robot, "link", name=WORLD_LINK)
        for part in parts:
            robot.extend(_rounded(link, mass_scale) for link in part.findall("link"))
        for joint in self.fixed_joints:
            _add_joint(robot, joint, "fixed")
        for name, bounds in self.limits.items():
            joint = self.arm.joints[name]
            element = _add_joint(robot, joint, "revolute")
            ElementTree.SubElement(element, "axis", xyz=" ".join(f"{value:g}" for value in joint.axis))
            ElementTree.SubElement(
                element, "limit", {key: repr(float(value)) for key, value in bounds.items()}
            )
        ElementTree.indent(robot)
        return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def numbers(values: tuple[float, ...]) -> str:
    """Numbers as URDF has them: nine digits."""
    return " ".join(f"{value:.9g}" for value in values)


def _rounded(link: ElementTree.Element, mass_scale: float) -> ElementTree.Element:
    result = copy.deepcopy(link)
    for element in result.iter():
        for key, text in element.attrib.items():
            if key in ("xyz", "rpy", "size", "radius", "length"):
                element.set(key, numbers(tuple(float(word) for word in text.split())))
    inertial = result.find("inertial")
    if inertial is None:
        # A frame without a body. Bullet would give it 1 kg and 1 kg m^2 unless told that it weighs nothing.
        inertial = ElementTree.SubElement(result, "inertial")
        ElementTree.SubElement(inertial, "mass", value="0")
        ElementTree.SubElement(inertial, "inertia", dict.fromkeys(_TENSOR, "0"))
    else:
        for tag in ("mass", "inertia"):
            part = inertial.find(tag)
            if part is not None:
                for key, text in part.attrib.items():
                    part.set(key, f"{float(text) * mass_scale:.9g}")
    return result


def _add_joint(robot: ElementTree.Element, joint: JointOrigin, kind: str) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=kind)
    ElementTree.SubElement(element, "origin", xyz=numbers(joint.offset), rpy=numbers(joint.roll_pitch_yaw))
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    return element
