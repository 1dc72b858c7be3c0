"""From a robot description to a chain of joints: frames and masses as the compiled functions want them.

Links that are fixed to a link of the chain are part of it. A joint that does not turn about its own z gets a
frame that does: the frames of the chain are ours, those of the URDF stay what they are for everybody else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.urdf import Description, JointOrigin, LinkInertia

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


class Body(NamedTuple):
    """Mass (kg), centre (3,) in m and inertia (3, 3) in kg m^2 about it, in some link's frame."""

    mass: float
    centre: Array
    inertia: Array


class Frame(NamedTuple):
    """Where something is: position (3,) in m and rotation (3, 3)."""

    position: Array
    rotation: Array

    def then(self, inner: Frame) -> Frame:
        """The frame that is `inner` in this one."""
        return Frame(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)


class Chain(NamedTuple):
    """N joints from the root link to the paddle.

    Attributes
    ----------
    joints
        Frame of each joint on the link before it.
    bodies
        What each joint carries, the paddle included.
    paddle
        Frame of the paddle on the last link.
    places
        By link: which joint carries it (-1: the root) and its frame on what that joint carries.
    """

    joints: list[Frame]
    bodies: list[Body]
    paddle: Frame
    places: dict[str, tuple[int, Frame]]


def rotation_from_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix (3, 3) of fixed-axis roll, pitch and yaw in rad, as URDF has them."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def frame(position: Vector, roll_pitch_yaw: Vector) -> Frame:
    """A frame as URDF and robot.yaml give it."""
    return Frame(np.array(position, dtype=np.float64), rotation_from_roll_pitch_yaw(*roll_pitch_yaw))


def find_chain(
    description: Description, names: tuple[str, ...], mount: JointOrigin, paddle: LinkInertia
) -> Chain:
    """Follow the joints from the root link to the paddle.

    Parameters
    ----------
    description
        The arm.
    names
        Its joints, from the base to the hand.
    mount
        Where the paddle sits.
    paddle
        Mass properties of the paddle.

    Raises
    ------
    UserError
        If the joints are not one chain that ends at the paddle, or something of it moves that is not named.
    """
    _require_chain(description, names, mount)
    places: dict[str, tuple[int, Frame]] = {description.root_link: (-1, frame((0, 0, 0), (0, 0, 0)))}
    joints: list[Frame | None] = [None] * len(names)
    waiting = list(description.joints.values())
    while waiting:
        left = [joint for joint in waiting if joint.parent not in places]
        for joint in waiting:
            if joint.parent not in places:
                continue
            index, parent = places[joint.parent]
            own = frame(joint.offset, joint.roll_pitch_yaw)
            here = own if _is_identity(parent) else parent.then(own)
            if joint.name in names:
                turn = _z_onto(joint.axis, f"{description.path}: joint {joint.name}")
                number = names.index(joint.name)
                joints[number] = here if turn is None else Frame(here.position, here.rotation @ turn)
                inner = frame((0, 0, 0), (0, 0, 0)) if turn is None else Frame(np.zeros(3), turn.T)
                places[joint.child] = (number, inner)
            else:
                places[joint.child] = (index, here)
        waiting = left
    on, there = places[mount.parent]
    assert on == len(names) - 1
    hand = frame(mount.offset, mount.roll_pitch_yaw)
    hand = hand if _is_identity(there) else there.then(hand)
    bodies = [_empty() for _ in names]
    # From the base outwards, each joint's own link first.
    for name, inertia in description.links.items():
        index, where = places[name]
        if index >= 0:
            body = _body(inertia, where)
            bodies[index] = body if bodies[index].mass == 0.0 else _joined(bodies[index], body)
    bodies[-1] = _joined(bodies[-1], _body(paddle, hand))
    return Chain([joint for joint in joints if joint is not None], bodies, hand, places)


def link_places(chain: Chain, base: Frame, joint_position: Array) -> list[Frame]:
    """Frames of the links behind the joints in `world`, at the given angles (N,) in rad."""
    places = []
    here = base
    for joint, angle in zip(chain.joints, joint_position.tolist(), strict=True):
        here = here.then(joint).then(frame((0.0, 0.0, 0.0), (0.0, 0.0, angle)))
        places.append(here)
    return places


def _require_chain(description: Description, names: tuple[str, ...], mount: JointOrigin) -> None:
    """Refuse joints that do not lead, one after the other, from the root to the paddle."""
    path = description.path
    for name in names:
        joint = description.joints.get(name)
        if joint is None:
            known = ", ".join(j.name for j in description.joints.values() if j.kind != "fixed")
            raise UserError(f"{path}: joint {name} is missing; add it, or list others (it has {known})")
        if joint.kind not in ("revolute", "continuous"):
            raise UserError(f"{path}: joint {name} is {joint.kind}; only revolute joints are supported")
    if mount.parent not in description.links:
        raise UserError(
            f"{path}: no link {mount.parent!r} for the paddle; set paddle.link to one of "
            f"{', '.join(description.links)}"
        )
    found: list[str] = []
    link = mount.parent
    while (joint := description.carrier(link)) is not None:
        if joint.name in names:
            found.append(joint.name)
        elif joint.kind != "fixed":
            raise UserError(
                f"{path}: joint {joint.name} is between base and paddle and not listed; add it to `joints`, "
                "or make it fixed"
            )
        link = joint.parent
    found.reverse()
    if tuple(found) != names:
        raise UserError(
            f"{path}: the joints from the base to the paddle's link {mount.parent} are "
            f"{', '.join(found) or 'none'}; list just these, in this order, in `joints`"
        )


def _is_identity(place: Frame) -> bool:
    return not place.position.any() and bool(np.array_equal(place.rotation, np.eye(3)))


def _z_onto(axis: Vector, where: str) -> Array | None:
    """Rotation (3, 3) that turns z onto `axis`; None for z itself."""
    direction = np.array(axis, dtype=np.float64)
    length = float(np.linalg.norm(direction))
    if not length > 0.0 or not math.isfinite(length):
        raise UserError(f"{where}: its axis {axis} has no direction; write a unit vector")
    direction /= length
    if direction[2] == 1.0:
        return None
    side = np.eye(3)[int(np.argmin(np.abs(direction)))]
    across = np.cross(side, direction)
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(direction, across), direction])


def _empty() -> Body:
    return Body(0.0, np.zeros(3), np.zeros((3, 3)))


def _body(link: LinkInertia, where: Frame) -> Body:
    """Mass properties of a link in the frame in which it sits at `where`."""
    ixx, ixy, ixz, iyy, iyz, izz = link.inertia
    inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if any(link.roll_pitch_yaw):
        own = rotation_from_roll_pitch_yaw(*link.roll_pitch_yaw)
        inertia = own @ inertia @ own.T
    centre = np.array(link.centre)
    if not np.array_equal(where.rotation, np.eye(3)):
        centre = where.rotation @ centre
        inertia = where.rotation @ inertia @ where.rotation.T
    return Body(link.mass, centre + where.position, inertia)


def _joined(first: Body, second: Body) -> Body:
    """Two bodies that are fixed to each other, as one."""
    mass = first.mass + second.mass
    centre = (first.mass * first.centre + second.mass * second.centre) / mass
    inertia = np.zeros((3, 3))
    for part in (first, second):
        arm = part.centre - centre
        inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Body(mass, centre, inertia)
