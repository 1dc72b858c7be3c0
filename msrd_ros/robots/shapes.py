"""What the arm looks like: cylinders, spheres and boxes of our own, sized after a Sawyer.

Solid shapes also collide; the others only meet the eye.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrd_ros.robots.sawyer_description import (
    BASE_POSITION,
    BLADE_CENTRE_BEYOND_FLANGE_M,
    BLADE_RADIUS_M,
    BLADE_THICKNESS_M,
    Vector,
)

Colour = tuple[float, float, float, float]

COLOURS: dict[str, Colour] = {
    "sawyer_red": (0.62, 0.06, 0.09, 1.0),
    "sawyer_grey": (0.24, 0.25, 0.27, 1.0),
    "sawyer_black": (0.07, 0.07, 0.08, 1.0),
    "sawyer_silver": (0.68, 0.69, 0.71, 1.0),
    "screen": (0.02, 0.09, 0.14, 1.0),
    "eye_white": (0.92, 0.95, 0.97, 1.0),
    "rubber_red": (0.80, 0.10, 0.10, 1.0),
    "rubber_black": (0.09, 0.09, 0.10, 1.0),
    "wood": (0.76, 0.57, 0.34, 1.0),
}


@dataclass(frozen=True)
class Shape:
    """One primitive on a link.

    `kind` is ``cylinder`` (size: radius, length; along its own z), ``sphere`` (radius) or ``box`` (x, y, z),
    all in m; `centre` in m and `roll_pitch_yaw` in rad in the frame of the link.
    """

    kind: str
    size: tuple[float, ...]
    colour: str
    centre: Vector = (0.0, 0.0, 0.0)
    roll_pitch_yaw: Vector = (0.0, 0.0, 0.0)
    solid: bool = False


def tube(start: Vector, end: Vector, radius: float, colour: str, *, solid: bool = False) -> Shape:
    """Cylinder between two points of the link."""
    dx, dy, dz = (b - a for a, b in zip(start, end, strict=True))
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    centre = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, (start[2] + end[2]) / 2)
    # Pitch, then yaw, turn z onto the direction of the tube.
    turn = (0.0, math.acos(max(-1.0, min(1.0, dz / length))), math.atan2(dy, dx))
    return Shape("cylinder", (radius, length), colour, centre, turn, solid)


def ball(centre: Vector, radius: float, colour: str, *, solid: bool = False) -> Shape:
    """Sphere on the link."""
    return Shape("sphere", (radius,), colour, centre, solid=solid)


def box(size: Vector, centre: Vector, colour: str, turn: Vector = (0.0, 0.0, 0.0)) -> Shape:
    """Box on the link."""
    return Shape("box", size, colour, centre, turn)


RED, GREY, BLACK, SILVER = "sawyer_red", "sawyer_grey", "sawyer_black", "sawyer_silver"
_PEDESTAL = BASE_POSITION[2]
_RUBBER = BLADE_THICKNESS_M / 4

LINK_SHAPES: dict[str, tuple[Shape, ...]] = {
    "right_arm_base_link": (
        box((0.56, 0.56, 0.03), (-0.04, 0.0, 0.025 - _PEDESTAL), BLACK),
        box((0.40, 0.40, 0.05), (-0.04, 0.0, 0.06 - _PEDESTAL), GREY),
        box((0.20, 0.24, _PEDESTAL - 0.10), (-0.02, 0.0, (0.06 - _PEDESTAL) / 2 - 0.01), BLACK),
        tube((0.0, 0.0, -0.04), (0.0, 0.0, 0.0), 0.135, GREY),
        tube((0.0, 0.0, 0.0), (0.0, 0.0, 0.075), 0.105, BLACK),
    ),
    "right_l0": (
        tube((0.0, 0.0, 0.0), (0.0, 0.0, 0.03), 0.098, SILVER),
        tube((0.0, 0.0, 0.03), (0.0, 0.0, 0.27), 0.092, RED),
        tube((0.0, 0.0, 0.27), (0.0, 0.0, 0.285), 0.080, GREY),
        tube((0.02, -0.01, 0.237), (0.081, -0.01, 0.237), 0.072, RED),
        tube((0.081, -0.085, 0.237), (0.081, 0.045, 0.237), 0.078, RED),
        tube((0.081, -0.098, 0.237), (0.081, -0.085, 0.237), 0.062, BLACK),
    ),
    "head": (
        tube((0.0, 0.0, -0.01), (0.0, 0.0, 0.05), 0.045, GREY),
        box((0.045, 0.29, 0.19), (0.025, 0.0, 0.135), BLACK, (0.0, 0.10, 0.0)),
        box((0.004, 0.265, 0.165), (0.0485, 0.0, 0.133), "screen", (0.0, 0.10, 0.0)),
        tube((0.048, 0.060, 0.140), (0.053, 0.060, 0.1395), 0.036, "eye_white"),
        tube((0.048, -0.060, 0.140), (0.053, -0.060, 0.1395), 0.036, "eye_white"),
        tube((0.050, 0.056, 0.135), (0.0555, 0.056, 0.1345), 0.017, BLACK),
        tube((0.050, -0.056, 0.135), (0.0555, -0.056, 0.1345), 0.017, BLACK),
    ),
    "right_l1": (
        tube((0.0, 0.0, -0.003), (0.0, 0.0, 0.012), 0.072, SILVER),
        tube((0.0, 0.0, 0.012), (0.0, 0.0, 0.205), 0.073, RED),
        tube((0.0, 0.0, 0.205), (0.0, 0.0, 0.216), 0.058, BLACK),
        tube((0.0, 0.0, 0.1425), (0.0, -0.135, 0.1425), 0.066, RED),
    ),
    "right_l2": (
        tube((0.0, 0.0, -0.006), (0.0, 0.0, 0.010), 0.063, SILVER),
        tube((0.0, 0.0, 0.010), (0.0, 0.0, 0.215), 0.060, RED, solid=True),
        tube((0.0, 0.0, 0.10), (0.0, 0.0, 0.125), 0.0615, GREY),
        tube((0.0, 0.062, 0.26), (0.0, -0.036, 0.26), 0.064, GREY, solid=True),
        tube((0.0, 0.072, 0.26), (0.0, 0.062, 0.26), 0.050, BLACK),
    ),
    "right_l3": (
        tube((0.0, 0.0, 0.006), (0.0, 0.0, -0.010), 0.058, SILVER),
        tube((0.0, 0.0, -0.010), (0.0, 0.0, -0.182), 0.060, RED, solid=True),
        tube((0.0, 0.0, -0.182), (0.0, 0.0, -0.192), 0.047, BLACK),
        tube((0.0, 0.0, -0.1265), (0.0, -0.120, -0.1265), 0.054, RED, solid=True),
    ),
    "right_l4": (
        tube((0.0, 0.0, -0.006), (0.0, 0.0, 0.010), 0.052, SILVER),
        tube((0.0, 0.0, 0.010), (0.0, 0.0, 0.235), 0.048, RED, solid=True),
        tube((0.0, 0.0, 0.12), (0.0, 0.0, 0.145), 0.0495, GREY),
        tube((0.0, -0.055, 0.275), (0.0, 0.026, 0.275), 0.052, GREY, solid=True),
        tube((0.0, -0.064, 0.275), (0.0, -0.055, 0.275), 0.040, BLACK),
    ),
    "right_l5": (
        tube((0.0, 0.0, -0.006), (0.0, 0.0, 0.010), 0.047, SILVER),
        tube((0.0, 0.0, 0.010), (0.0, 0.0, 0.152), 0.049, RED, solid=True),
        tube((0.0, 0.0, 0.152), (0.0, 0.0, 0.160), 0.038, BLACK),
        tube((0.0, 0.0, 0.1053), (0.0, -0.085, 0.1053), 0.044, RED, solid=True),
    ),
    "right_l6": (
        tube((0.0, 0.0, -0.026), (0.0, 0.0, -0.010), 0.043, SILVER),
        tube((0.0, 0.0, -0.010), (0.0, 0.0, 0.022), 0.041, BLACK, solid=True),
        tube((0.0, 0.0, 0.022), (0.0, 0.0, 0.034), 0.030, SILVER),
        tube((0.0, 0.0, 0.034), (0.0, 0.0, 0.050), 0.020, GREY),
    ),
    # The origin is the blade's centre, the axes are those of right_l6.
    "paddle": (
        tube(
            (0.0, 0.0, 0.045 - BLADE_CENTRE_BEYOND_FLANGE_M), (0.0, 0.0, -0.062), 0.0135, "wood", solid=True
        ),
        box((0.052, 0.010, 0.030), (0.0, 0.0, -0.075), "wood"),
        tube((0.0, _RUBBER, 0.0), (0.0, 2 * _RUBBER, 0.0), BLADE_RADIUS_M, "rubber_red"),
        tube((0.0, -_RUBBER, 0.0), (0.0, _RUBBER, 0.0), BLADE_RADIUS_M + 0.001, "wood", solid=True),
        tube((0.0, -2 * _RUBBER, 0.0), (0.0, -_RUBBER, 0.0), BLADE_RADIUS_M, "rubber_black"),
    ),
}
