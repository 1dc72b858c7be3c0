"""The bodies that the ball meets: signed distances to table, net, floor and blade.

A paddle is twelve floats: the blade's centre (m), the unit normal of its forehand face, the centre's velocity
(m/s) and the angular velocity (rad/s), world frame.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.scene import SceneConstants

PADDLE_SIZE = 12

NO_CONTACT = 0
TABLE = 1
TABLE_SIDE = 2
NET = 4
FLOOR = 8
PADDLE = 16
"""Surfaces, as bits: `TABLE` is the playing surface with its upper edge, `TABLE_SIDE` everything below it."""

NO_PADDLE: NDArray[np.float64] = np.array([0.0, 0.0, 1e6, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
NO_PADDLE.setflags(write=False)
"""A paddle out of everyone's reach."""

Gap = tuple[float, float, float, float]
"""Distance in m from the ball's centre to the nearest point of a surface, and the unit vector from there."""


@njit(cache=True)
def box_gap(x: float, y: float, z: float, half_x: float, half_y: float, bottom: float, top: float) -> Gap:
    """Signed distance of a point to a box about the z axis, and its gradient."""
    outside_x = abs(x) - half_x
    outside_y = abs(y) - half_y
    middle = 0.5 * (bottom + top)
    outside_z = abs(z - middle) - 0.5 * (top - bottom)
    sign_x = 1.0 if x >= 0.0 else -1.0
    sign_y = 1.0 if y >= 0.0 else -1.0
    sign_z = 1.0 if z >= middle else -1.0
    if outside_x <= 0.0 and outside_y <= 0.0 and outside_z <= 0.0:
        if outside_z >= outside_x and outside_z >= outside_y:
            return outside_z, 0.0, 0.0, sign_z
        if outside_x >= outside_y:
            return outside_x, sign_x, 0.0, 0.0
        return outside_y, 0.0, sign_y, 0.0
    gx, gy, gz = max(outside_x, 0.0), max(outside_y, 0.0), max(outside_z, 0.0)
    distance = math.sqrt(gx * gx + gy * gy + gz * gz)
    return distance, sign_x * gx / distance, sign_y * gy / distance, sign_z * gz / distance


@njit(cache=True)
def blade_gap(
    x: float,
    y: float,
    z: float,
    nx: float,
    ny: float,
    nz: float,
    radius: float,
    half_thickness: float,
) -> Gap:
    """Signed distance of a point to a disk about the origin with unit normal n, and its gradient."""
    height = x * nx + y * ny + z * nz
    px, py, pz = x - height * nx, y - height * ny, z - height * nz
    reach = math.sqrt(px * px + py * py + pz * pz)
    above = abs(height) - half_thickness
    beyond = reach - radius
    face = 1.0 if height >= 0.0 else -1.0
    if beyond <= 0.0 and above >= beyond:
        return above, face * nx, face * ny, face * nz
    px, py, pz = px / reach, py / reach, pz / reach
    if above <= 0.0:
        return beyond, px, py, pz
    distance = math.sqrt(above * above + beyond * beyond)
    along, across = face * above / distance, beyond / distance
    return distance, along * nx + across * px, along * ny + across * py, along * nz + across * pz


@njit(cache=True)
def fixed_gap(surface: int, x: float, y: float, z: float, scene: SceneConstants) -> Gap:
    """Gap between the skin of a ball at (x, y, z) and table, net or floor, and the outward normal."""
    if surface == TABLE:
        distance, gx, gy, gz = box_gap(
            x, y, z, scene.table_half_length, scene.table_half_width, scene.table_underside, scene.table_top
        )
    elif surface == NET:
        distance, gx, gy, gz = box_gap(
            x, y, z, scene.net_half_thickness, scene.net_half_width, scene.table_top, scene.net_top
        )
    else:
        distance, gx, gy, gz = z, 0.0, 0.0, 1.0
    return distance - scene.ball_radius, gx, gy, gz
