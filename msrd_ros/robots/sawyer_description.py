"""Published kinematics and inertias of the Sawyer arm, and the paddle in its hand.

Source: Rethink Robotics, sawyer_description (Apache-2.0). Limits of the joints are on the ground floor, in
`msrd_ros.robots.sawyer`; the shapes to look at are our own, in `msrd_ros.robots.urdf`.
"""

from __future__ import annotations

from typing import NamedTuple

Vector = tuple[float, float, float]


class LinkInertia(NamedTuple):
    """Mass (kg), centre of mass (m, link frame) and inertia ixx, ixy, ixz, iyy, iyz, izz (kg m^2)."""

    name: str
    mass: float
    centre: Vector
    inertia: tuple[float, float, float, float, float, float]


class JointOrigin(NamedTuple):
    """Where a joint sits on its parent link: offset in m and fixed-axis roll, pitch, yaw in rad.

    Every joint of the arm turns about its own z axis.
    """

    name: str
    parent: str
    child: str
    offset: Vector
    roll_pitch_yaw: Vector


BASE_POSITION: Vector = (-2.30, 0.0, 0.91)
"""`right_arm_base_link` in the world: 0.93 m behind the end line of the table, on the pedestal."""

LINK_INERTIAS: tuple[LinkInertia, ...] = (
    LinkInertia(
        "right_arm_base_link",
        2.0687,
        (-0.0006241, -2.8025e-05, 0.065404),
        (0.0067599, -4.2024e-05, -6.1904e-07, 0.0067877, 1.5888e-05, 0.0074031),
    ),
    LinkInertia(
        "right_l0",
        5.3213,
        (0.024366, 0.010969, 0.14363),
        (0.053314, 0.0047093, 0.011734, 0.057902, 0.0080179, 0.023659),
    ),
    LinkInertia(
        "right_l1",
        4.505,
        (-0.0030849, -0.026811, 0.092521),
        (0.022398, -0.00023986, -0.00029362, 0.014613, -0.0060875, 0.017295),
    ),
    LinkInertia(
        "right_l2",
        1.745,
        (-0.00016044, -0.014967, 0.13582),
        (0.025506, 4.4101e-06, 1.4955e-05, 0.0253, -0.0033204, 0.0034179),
    ),
    LinkInertia(
        "right_l3",
        2.5097,
        (-0.0048135, -0.0281, -0.084154),
        (0.01016, -9.7452e-06, 0.00026624, 0.0065685, 0.0030316, 0.0069078),
    ),
    LinkInertia(
        "right_l4",
        1.1136,
        (-0.0018844, 0.0069001, 0.1341),
        (0.013557, 1.8109e-05, 0.00013523, 0.013555, 0.0010561, 0.0013658),
    ),
    LinkInertia(
        "right_l5",
        1.5625,
        (0.0061133, -0.023697, 0.076416),
        (0.0047328, 0.00011526, 4.6269e-05, 0.0029676, -0.0011557, 0.0031762),
    ),
    LinkInertia(
        "right_l6",
        0.3292,
        (-8.0726e-06, 0.0085838, -0.0049566),
        (0.00031105, 1.4771e-06, -3.7074e-07, 0.00021549, -8.4533e-06, 0.00035976),
    ),
    LinkInertia(
        "head",
        1.5795,
        (0.0053207, -2.6549e-05, 0.1021),
        (0.011833, -4.4669e-06, 4.9425e-05, 0.0082709, 4.2124e-07, 0.0049661),
    ),
)

ARM_JOINTS: tuple[JointOrigin, ...] = (
    JointOrigin("right_j0", "right_arm_base_link", "right_l0", (0.0, 0.0, 0.08), (0.0, 0.0, 0.0)),
    JointOrigin(
        "right_j1", "right_l0", "right_l1", (0.081, 0.05, 0.237), (-1.57079632679, 1.57079632679, 0.0)
    ),
    JointOrigin("right_j2", "right_l1", "right_l2", (0.0, -0.14, 0.1425), (1.57079632679, 0.0, 0.0)),
    JointOrigin("right_j3", "right_l2", "right_l3", (0.0, -0.042, 0.26), (-1.57079632679, 0.0, 0.0)),
    JointOrigin("right_j4", "right_l3", "right_l4", (0.0, -0.125, -0.1265), (1.57079632679, 0.0, 0.0)),
    JointOrigin("right_j5", "right_l4", "right_l5", (0.0, 0.031, 0.275), (-1.57079632679, 0.0, 0.0)),
    JointOrigin("right_j6", "right_l5", "right_l6", (0.0, -0.11, 0.1053), (-1.57079632679, -0.17453, 3.1416)),
)
"""The seven actuated joints, base to hand."""

HEAD_JOINT = JointOrigin("head_pan", "right_l0", "head", (0.0, 0.0, 0.2965), (0.0, 0.0, 0.0))
"""The head turns on the real robot; here it looks ahead and is fixed."""

PADDLE_MASS_KG = 0.25
BLADE_CENTRE_BEYOND_FLANGE_M = 0.2045
"""The handle lies along z of `right_l6`; the blade's centre is this far beyond its origin.

The blade's normal is the y axis of `right_l6`: the front face looks to +y, the back face to -y.
"""
BLADE_RADIUS_M = 0.075
BLADE_THICKNESS_M = 0.012

HANDLE_MASS_SHARE = 0.3
HANDLE_LENGTH_M = 0.10


def paddle_inertia() -> LinkInertia:
    """Mass properties of the paddle in the frame of its blade: a disc with a rod for a handle."""
    handle = HANDLE_MASS_SHARE * PADDLE_MASS_KG
    blade = PADDLE_MASS_KG - handle
    handle_z = -(BLADE_RADIUS_M + HANDLE_LENGTH_M / 2)
    centre_z = handle * handle_z / PADDLE_MASS_KG
    about_diameter = blade * (BLADE_RADIUS_M**2 / 4 + BLADE_THICKNESS_M**2 / 12)
    about_axis = blade * BLADE_RADIUS_M**2 / 2
    # Of both parts about the common centre of mass, for axes across the handle.
    swing = handle * (HANDLE_LENGTH_M**2 / 12 + (handle_z - centre_z) ** 2) + blade * centre_z**2
    moments = (about_diameter + swing, 0.0, 0.0, about_axis + swing, 0.0, about_diameter)
    return LinkInertia("paddle", PADDLE_MASS_KG, (0.0, 0.0, centre_z), moments)
