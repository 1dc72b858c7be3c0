"""Static transforms of a robot, from its description.

robot_state_publisher sends the fixed joints of the description on ``/tf_static``. Where nobody does (tf2_msgs
is no wheel, so an installation without ROS cannot), a bag gets them from here.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

from msrd_ros.bags.schemas import serialise, typestore


def static_transforms_from_urdf(urdf: str, stamp_ns: int) -> bytes | None:
    """Serialised tf2_msgs/TFMessage with the fixed joints of a robot description.

    Parameters
    ----------
    urdf
        Robot description as XML.
    stamp_ns
        Stamp of the transforms in nanoseconds.

    Returns
    -------
    CDR, or None if the description is not readable or has no fixed joint.
    """
    try:
        joints = ElementTree.fromstring(urdf).findall("joint[@type='fixed']")
    except ElementTree.ParseError:
        return None
    transforms = [_transform(joint, stamp_ns) for joint in joints]
    if not transforms:
        return None
    message: Any = typestore().types["tf2_msgs/msg/TFMessage"]
    return serialise(message(transforms), "tf2_msgs/msg/TFMessage")


def _transform(joint: ElementTree.Element, stamp_ns: int) -> Any:
    types: Any = typestore().types
    origin = joint.find("origin")
    xyz = _numbers(origin, "xyz")
    quaternion = types["geometry_msgs/msg/Quaternion"](*_quaternion(*_numbers(origin, "rpy")))
    stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 1_000_000_000))
    return types["geometry_msgs/msg/TransformStamped"](
        types["std_msgs/msg/Header"](stamp, _link(joint, "parent")),
        _link(joint, "child"),
        types["geometry_msgs/msg/Transform"](types["geometry_msgs/msg/Vector3"](*xyz), quaternion),
    )


def _numbers(origin: ElementTree.Element | None, name: str) -> list[float]:
    text = "" if origin is None else origin.get(name, "")
    return [float(word) for word in text.split()] or [0.0, 0.0, 0.0]


def _link(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Quaternion x, y, z, w of URDF's fixed-axis roll, pitch, yaw."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
