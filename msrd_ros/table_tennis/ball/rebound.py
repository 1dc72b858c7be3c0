"""Rebounds: what a touch does to the ball. Where and when it touches is in `surfaces` and `touch`.

Both laws act on a ball of nine floats in place, at a point of contact whose outward normal is (nx, ny, nz).
Impulses act at the ball's surface, at -radius * normal from its centre; the ball is a thin shell.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.scene import SceneConstants


@njit(cache=True)
def slip_velocity(
    ball: NDArray[np.float64],
    nx: float,
    ny: float,
    nz: float,
    surface_x: float,
    surface_y: float,
    surface_z: float,
    radius: float,
) -> tuple[float, float, float, float]:
    """Speed of separation (negative: approach) and slip of the ball's surface at the contact, m/s.

    Returns
    -------
    tuple
        Normal speed v_n of the ball's centre relative to the surface, and the tangential velocity of the
        ball's contact point: v - v_n n + spin x (-radius n).
    """
    vx, vy, vz = ball[3] - surface_x, ball[4] - surface_y, ball[5] - surface_z
    normal_speed = vx * nx + vy * ny + vz * nz
    wx, wy, wz = ball[6], ball[7], ball[8]
    return (
        normal_speed,
        vx - normal_speed * nx - radius * (wy * nz - wz * ny),
        vy - normal_speed * ny - radius * (wz * nx - wx * nz),
        vz - normal_speed * nz - radius * (wx * ny - wy * nx),
    )


@njit(cache=True)
def apply_impulse(
    ball: NDArray[np.float64],
    nx: float,
    ny: float,
    nz: float,
    jx: float,
    jy: float,
    jz: float,
    scene: SceneConstants,
) -> None:
    """Apply an impulse (N s) at the ball's contact point, in place."""
    ball[3] += jx / scene.ball_mass
    ball[4] += jy / scene.ball_mass
    ball[5] += jz / scene.ball_mass
    lever = -scene.ball_radius / scene.ball_inertia
    ball[6] += lever * (ny * jz - nz * jy)
    ball[7] += lever * (nz * jx - nx * jz)
    ball[8] += lever * (nx * jy - ny * jx)


@njit(cache=True)
def rebound_rigid(
    ball: NDArray[np.float64],
    nx: float,
    ny: float,
    nz: float,
    restitution: float,
    friction: float,
    scene: SceneConstants,
) -> None:
    """Rebound off a rigid surface at rest: restitution and Coulomb friction, in place.

    The contact slides as long as friction cannot stop the slip, and grips (slip zero, rolling) when it can:
    |J_t| = min(friction |J_n|, |slip| / (1 / m + r^2 / I)). For a thin shell the second term is 2/5 m |slip|,
    as in Nakashima et al. 2010 and Hayakawa et al. 2016. A ball that moves away is left alone.
    """
    normal_speed, sx, sy, sz = slip_velocity(ball, nx, ny, nz, 0.0, 0.0, 0.0, scene.ball_radius)
    if normal_speed >= 0.0:
        return
    normal_impulse = -(1.0 + restitution) * normal_speed * scene.ball_mass
    slip = math.sqrt(sx * sx + sy * sy + sz * sz)
    tangential = 0.0
    if slip > 0.0:
        mobility = 1.0 / scene.ball_mass + scene.ball_radius**2 / scene.ball_inertia
        tangential = min(friction * normal_impulse, slip / mobility) / slip
    apply_impulse(
        ball,
        nx,
        ny,
        nz,
        normal_impulse * nx - tangential * sx,
        normal_impulse * ny - tangential * sy,
        normal_impulse * nz - tangential * sz,
        scene,
    )


@njit(cache=True)
def rebound_rubber(
    ball: NDArray[np.float64],
    nx: float,
    ny: float,
    nz: float,
    surface_x: float,
    surface_y: float,
    surface_z: float,
    scene: SceneConstants,
) -> None:
    """Rebound off rubber that moves with (surface_x, surface_y, surface_z) m/s at the contact, in place.

    Restitution e = e0 - loss |v_n|; tangential impulse -k_p slip, by which the slip reverses (tt_rackets).
    The paddle is so much heavier, and held, that it does not feel the ball. A ball that moves away is left
    alone.
    """
    normal_speed, sx, sy, sz = slip_velocity(
        ball, nx, ny, nz, surface_x, surface_y, surface_z, scene.ball_radius
    )
    if normal_speed >= 0.0:
        return
    restitution = max(scene.rubber_restitution + scene.rubber_restitution_loss * normal_speed, 0.0)
    normal_impulse = -(1.0 + restitution) * normal_speed * scene.ball_mass
    stiffness = scene.rubber_tangential
    apply_impulse(
        ball,
        nx,
        ny,
        nz,
        normal_impulse * nx - stiffness * sx,
        normal_impulse * ny - stiffness * sy,
        normal_impulse * nz - stiffness * sz,
        scene,
    )
