"""The arm's outlines as one mesh a moving link: what a browser draws quickly."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.chain import Frame, frame
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.urdf import ORIGIN, WORLD_LINK, read_pose

Array = NDArray[np.float64]

_GREY = (0.6, 0.6, 0.6, 1.0)
_ROUGHNESS = 0.7
_SECTIONS = 24
"""Corners of a drawn circle."""


def arm_meshes(robot: Robot) -> dict[str, Any]:
    """A `trimesh.Trimesh` by link, in the link's frame: `world` for what stands, and those behind joints.

    What hangs on a link by fixed joints, such as the paddle, is part of its mesh.

    Raises
    ------
    UserError
        If the description has a shape other than box, cylinder and sphere; names robot and link.
    """
    root = ElementTree.fromstring(robot.urdf)
    colours = {
        str(material.get("name")): _numbers(colour.get("rgba", ""))
        for material in root.findall("material")
        if (colour := material.find("color")) is not None
    }
    carriers = {joint.child: joint for joint in robot.standing.fixed_joints}
    parts: dict[str, list[Any]] = {name: [] for name in (WORLD_LINK, *robot.link_names)}
    for link in root.findall("link"):
        name, placed = str(link.get("name")), frame(ORIGIN, ORIGIN)
        where = f"robot {robot.name}: link {name}"
        while name not in parts:
            joint = carriers[name]
            placed = frame(joint.offset, joint.roll_pitch_yaw).then(placed)
            name = joint.parent
        for visual in link.findall("visual"):
            shape = _shape(visual, where)
            shape.visual = trimesh.visual.ColorVisuals(shape, face_colors=_colour(visual, colours))
            parts[name].append(shape.apply_transform(_matrix(placed.then(frame(*read_pose(visual, where))))))
    return {name: _painted(trimesh.util.concatenate(shapes)) for name, shapes in parts.items() if shapes}


def _painted(mesh: Any) -> Any:
    """The same mesh in paint: without a material glTF has it of metal, which only mirrors what is around."""
    visual: Any = trimesh.visual
    paint = visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=_ROUGHNESS)
    colours = mesh.visual.vertex_colors
    mesh.visual = visual.TextureVisuals(material=paint)
    mesh.visual.vertex_attributes["color"] = colours
    return mesh


def _shape(visual: ElementTree.Element, where: str) -> Any:
    geometry = visual.find("geometry")
    kind = geometry[0] if geometry is not None and len(geometry) else ElementTree.Element("nothing")
    if kind.tag == "box":
        return trimesh.creation.box(extents=_numbers(kind.get("size", "")))
    if kind.tag == "cylinder":
        return trimesh.creation.cylinder(
            float(kind.get("radius", "")), float(kind.get("length", "")), sections=_SECTIONS
        )
    if kind.tag == "sphere":
        return trimesh.creation.icosphere(subdivisions=2, radius=float(kind.get("radius", "")))
    raise UserError(f"{where}: a {kind.tag} cannot be drawn; describe it by box, cylinder or sphere")


def _colour(visual: ElementTree.Element, colours: dict[str, list[float]]) -> Array:
    material = visual.find("material")
    if material is None:
        return _bytes(_GREY)
    own = material.find("color")
    named = colours.get(str(material.get("name")), list(_GREY))
    return _bytes(_numbers(own.get("rgba", "")) if own is not None else named)


def _bytes(colour: list[float] | tuple[float, ...]) -> Array:
    return np.round(255 * np.array(colour)).astype(np.uint8)


def _matrix(place: Frame) -> Array:
    """The homogeneous form (4, 4) of a frame."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = place.rotation, place.position
    return matrix


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]
