"""The ball in free flight: gravity, drag and Magnus force; the spin keeps.

A ball is nine floats: position (m), velocity (m/s) and spin (rad/s), world frame. The functions are
compiled and scalar, so that the Bullet simulator may call them once a millisecond and the batched
simulator in loops over episodes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.scene import SceneConstants

BALL_SIZE = 9
POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
SPIN = slice(6, 9)

LONGEST_FLIGHT_STEP_S = 0.005
"""Of the integration of free flight: at 12 m/s and 200 rad/s, below a micrometre over a whole flight."""

_STILL_M_S = 1e-12
"""So that a ball without speed and spin divides by something."""


def ball_state(
    position: ArrayLike, velocity: ArrayLike = (0.0, 0.0, 0.0), spin: ArrayLike = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Nine floats from position (m), velocity (m/s) and spin (rad/s), each of shape (3,)."""
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in (position, velocity, spin)])


@njit(cache=True)
def flight_acceleration(
    vx: float,
    vy: float,
    vz: float,
    wx: float,
    wy: float,
    wz: float,
    saturating_speed: float,
    scene: SceneConstants,
) -> tuple[float, float, float]:
    """Acceleration in m/s^2: -drag |v| v + magnus (spin x v) / (1 + saturation S) - g z.

    S = r |spin| / |v| is the spin ratio; the lift coefficient of this force is slope S / (1 + saturation S)
    across the spin, see `scene.Air`.

    Parameters
    ----------
    vx, vy, vz
        Velocity, m/s.
    wx, wy, wz
        Spin, rad/s.
    saturating_speed
        `saturating_speed` of the spin.
    scene
        The numbers of the scene.
    """
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    drag = scene.drag * speed
    magnus = scene.magnus * speed / (speed + saturating_speed)
    return (
        magnus * (wy * vz - wz * vy) - drag * vx,
        magnus * (wz * vx - wx * vz) - drag * vy,
        magnus * (wx * vy - wy * vx) - drag * vz - scene.gravity,
    )


@njit(cache=True)
def saturating_speed(wx: float, wy: float, wz: float, scene: SceneConstants) -> float:
    """Speed in m/s at which a spin (rad/s) has half the lift that it would have without saturation."""
    spin = math.sqrt(wx * wx + wy * wy + wz * wz)
    speed: float = scene.lift_saturation * scene.ball_radius * spin + _STILL_M_S
    return speed


@njit(cache=True)
def flight_step(ball: NDArray[np.float64], duration: float, scene: SceneConstants) -> None:
    """Move a ball (9,) by one Runge-Kutta step of fourth order, in place; touches nothing on the way.

    The acceleration does not depend on the position, so the position's part of the scheme collapses to
    p + h v + h^2 / 6 (k1 + k2 + k3).
    """
    h = duration
    vx, vy, vz = ball[3], ball[4], ball[5]
    wx, wy, wz = ball[6], ball[7], ball[8]
    slow = saturating_speed(wx, wy, wz, scene)
    ax, ay, az = flight_acceleration(vx, vy, vz, wx, wy, wz, slow, scene)
    half = 0.5 * h
    bx, by, bz = flight_acceleration(vx + half * ax, vy + half * ay, vz + half * az, wx, wy, wz, slow, scene)
    cx, cy, cz = flight_acceleration(vx + half * bx, vy + half * by, vz + half * bz, wx, wy, wz, slow, scene)
    dx, dy, dz = flight_acceleration(vx + h * cx, vy + h * cy, vz + h * cz, wx, wy, wz, slow, scene)
    sixth = h / 6.0
    ball[0] += h * (vx + sixth * (ax + bx + cx))
    ball[1] += h * (vy + sixth * (ay + by + cy))
    ball[2] += h * (vz + sixth * (az + bz + cz))
    ball[3] += sixth * (ax + 2.0 * (bx + cx) + dx)
    ball[4] += sixth * (ay + 2.0 * (by + cy) + dy)
    ball[5] += sixth * (az + 2.0 * (bz + cz) + dz)


@njit(cache=True, nogil=True)
def fly(ball: NDArray[np.float64], duration: float, scene: NDArray[np.void]) -> None:
    """Let a ball fly freely, in place: through everything, for drawing and predicting.

    Parameters
    ----------
    ball
        State, shape (9,).
    duration
        Seconds; negative flies backwards.
    scene
        `Scene.constants()`, shape (1,).
    """
    steps = max(1, math.ceil(abs(duration) / LONGEST_FLIGHT_STEP_S))
    for _ in range(steps):
        flight_step(ball, duration / steps, scene[0])


@njit(cache=True)
def mechanical_energy(ball: NDArray[np.float64], scene: NDArray[np.void]) -> float:
    """Energy in J of a ball (9,) over the floor: motion, spin and height."""
    constants = scene[0]
    speed_squared = ball[3] ** 2 + ball[4] ** 2 + ball[5] ** 2
    spin_squared = ball[6] ** 2 + ball[7] ** 2 + ball[8] ** 2
    energy: float = (
        0.5 * constants.ball_mass * speed_squared
        + 0.5 * constants.ball_inertia * spin_squared
        + constants.ball_mass * constants.gravity * ball[2]
    )
    return energy
