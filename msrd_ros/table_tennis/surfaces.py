"""Where the ball meets table, net, floor and paddle: signed distances, and the first touch in a step.

The first touch is found by leaps that can never pass it: with the gap g, its rate g' and a bound A on how
fast that rate can fall, no touch can come before the root of g + g' t - A t^2 / 2. For a ball heading for a
surface this is Newton's method, for one that passes by it is one long leap; nothing is sampled, so nothing
is tunnelled through.

A paddle is twelve floats: the blade's centre (m), the unit normal of its forehand face, the centre's velocity
(m/s) and the angular velocity (rad/s), world frame.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.table_tennis.scene import SceneConstants

PADDLE_SIZE = 12

NO_CONTACT = 0
TABLE = 1
TABLE_SIDE = 2
NET = 4
FLOOR = 8
PADDLE = 16
"""Surfaces, as bits: `TABLE` is the playing surface with its upper edge, `TABLE_SIDE` everything below it."""

_FIXED_ACCELERATION = 400.0
"""Bound A for surfaces at rest, m/s^2: a ball in flight at 25 m/s and 500 rad/s stays below 150."""
_PADDLE_ACCELERATION = 4000.0
"""Bound A for the paddle: a blade at 12 m/s and 30 rad/s with 200 m/s^2 stays below 2,000."""
_TOUCH = 1e-7
"""Gap in m that counts as a touch."""
REST_SPEED = 0.02
"""Approach in m/s below which a ball does not bounce off a surface at rest any more, but rests on it."""
_REST_DEPTH = 1e-5
"""What a resting ball sinks in, in m, before it is held up: so that it touches a few times a step, not
hundreds."""
_MOST_LEAPS = 1000

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
def _hermite(start: float, end: float, start_rate: float, end_rate: float, s: float, span: float) -> float:
    """Cubic through two values with two rates (per second), at the fraction `s` of `span` seconds."""
    rest = 1.0 - s
    return rest * rest * ((1.0 + 2.0 * s) * start + s * span * start_rate) + s * s * (
        (3.0 - 2.0 * s) * end - rest * span * end_rate
    )


@njit(cache=True)
def blade_pose(
    start: NDArray[np.float64], end: NDArray[np.float64], s: float, span: float
) -> tuple[float, float, float, float, float, float]:
    """Centre and unit normal of the blade at the fraction `s` of a step of `span` seconds."""
    nx = _hermite(
        start[3],
        end[3],
        start[10] * start[5] - start[11] * start[4],
        end[10] * end[5] - end[11] * end[4],
        s,
        span,
    )
    ny = _hermite(
        start[4],
        end[4],
        start[11] * start[3] - start[9] * start[5],
        end[11] * end[3] - end[9] * end[5],
        s,
        span,
    )
    nz = _hermite(
        start[5],
        end[5],
        start[9] * start[4] - start[10] * start[3],
        end[9] * end[4] - end[10] * end[3],
        s,
        span,
    )
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return (
        _hermite(start[0], end[0], start[6], end[6], s, span),
        _hermite(start[1], end[1], start[7], end[7], s, span),
        _hermite(start[2], end[2], start[8], end[8], s, span),
        nx / length,
        ny / length,
        nz / length,
    )


@njit(cache=True)
def blade_velocity(
    start: NDArray[np.float64], end: NDArray[np.float64], s: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Velocity in m/s of the blade's material at the offset (x, y, z) from its centre."""
    rest = 1.0 - s
    wx = rest * start[9] + s * end[9]
    wy = rest * start[10] + s * end[10]
    wz = rest * start[11] + s * end[11]
    return (
        rest * start[6] + s * end[6] + wy * z - wz * y,
        rest * start[7] + s * end[7] + wz * x - wx * z,
        rest * start[8] + s * end[8] + wx * y - wy * x,
    )


@njit(cache=True)
def paddle_gap(
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    time: float,
    duration: float,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    offset: float,
    span: float,
    scene: SceneConstants,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Gap between ball and blade `time` seconds after the ball's state, its rate and where it is.

    Parameters
    ----------
    ball, ball_end
        The ball's states `duration` seconds apart, shape (9,).
    start, end
        The paddle's states `span` seconds apart, shape (12,); the first lies `offset` seconds before `ball`.

    Returns
    -------
    tuple
        Gap (m), rate (m/s), outward normal (3), velocity of the surface (3).
    """
    s = time / duration
    x = _hermite(ball[0], ball_end[0], ball[3], ball_end[3], s, duration)
    y = _hermite(ball[1], ball_end[1], ball[4], ball_end[4], s, duration)
    z = _hermite(ball[2], ball_end[2], ball[5], ball_end[5], s, duration)
    turn = min((offset + time) / span, 1.0)
    cx, cy, cz, nx, ny, nz = blade_pose(start, end, turn, span)
    distance, gx, gy, gz = blade_gap(
        x - cx, y - cy, z - cz, nx, ny, nz, scene.blade_radius, scene.blade_half_thickness
    )
    sx, sy, sz = blade_velocity(
        start, end, turn, x - distance * gx - cx, y - distance * gy - cy, z - distance * gz - cz
    )
    vx = ball[3] + s * (ball_end[3] - ball[3])
    vy = ball[4] + s * (ball_end[4] - ball[4])
    vz = ball[5] + s * (ball_end[5] - ball[5])
    rate = gx * (vx - sx) + gy * (vy - sy) + gz * (vz - sz)
    return distance - scene.ball_radius, rate, gx, gy, gz, sx, sy, sz


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


@njit(cache=True)
def leap(gap: float, rate: float, acceleration: float) -> float:
    """Seconds within which a gap with this rate cannot close: root of gap + rate t - acceleration t^2 / 2."""
    return 2.0 * gap / (math.sqrt(rate * rate + 2.0 * acceleration * gap) - rate)


@njit(cache=True)
def may_touch_fixed(
    surface: int,
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    duration: float,
    scene: SceneConstants,
) -> bool:
    """Whether a ball comes near a surface at all: a cheap test that spares most steps the search."""
    # Between the ends the path bulges by no more than A / 8 duration^2.
    skin = scene.ball_radius + 0.125 * _FIXED_ACCELERATION * duration * duration
    if surface == TABLE:
        return min(ball[2], ball_end[2]) < scene.table_top + skin
    if surface == NET:
        reach = scene.net_half_thickness + skin
        return min(ball[0], ball_end[0]) < reach and max(ball[0], ball_end[0]) > -reach
    return min(ball[2], ball_end[2]) < skin


@njit(cache=True)
def may_touch_paddle(
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    span: float,
    scene: SceneConstants,
) -> bool:
    """Whether ball and blade come near each other at all; see `may_touch_fixed`."""
    reach = scene.ball_radius + scene.blade_radius + scene.blade_half_thickness
    distance_squared = 0.0
    for axis in range(3):
        distance_squared += (ball[axis] - start[axis]) ** 2
        # Twice what both move along this axis, and so more than any bulge of their paths.
        reach += 2.0 * abs(ball_end[axis] - ball[axis]) + span * abs(ball[3 + axis] - ball_end[3 + axis])
        reach += abs(end[axis] - start[axis]) + span * (abs(start[6 + axis]) + abs(end[6 + axis]))
    return distance_squared < reach * reach


@njit(cache=True)
def fixed_touch(
    surface: int,
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    duration: float,
    scene: SceneConstants,
) -> float:
    """Seconds until a ball touches table, net or floor on its way to `ball_end`; `duration` if never."""
    time = 0.0
    for _ in range(_MOST_LEAPS):
        s = time / duration
        gap, gx, gy, gz = fixed_gap(
            surface,
            _hermite(ball[0], ball_end[0], ball[3], ball_end[3], s, duration),
            _hermite(ball[1], ball_end[1], ball[4], ball_end[4], s, duration),
            _hermite(ball[2], ball_end[2], ball[5], ball_end[5], s, duration),
            scene,
        )
        rate = (
            gx * (ball[3] + s * (ball_end[3] - ball[3]))
            + gy * (ball[4] + s * (ball_end[4] - ball[4]))
            + gz * (ball[5] + s * (ball_end[5] - ball[5]))
        )
        if gap <= (_TOUCH if rate < -REST_SPEED else -_REST_DEPTH) and rate < 0.0:
            return time
        time += leap(max(gap, _TOUCH), rate, _FIXED_ACCELERATION)
        if time >= duration:
            break
    return duration


@njit(cache=True)
def paddle_touch(
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    duration: float,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    offset: float,
    span: float,
    scene: SceneConstants,
) -> float:
    """Seconds until a ball touches the moving blade; `duration` if it does not. See `paddle_gap`."""
    time = 0.0
    for _ in range(_MOST_LEAPS):
        gap, rate, _, _, _, _, _, _ = paddle_gap(
            ball, ball_end, time, duration, start, end, offset, span, scene
        )
        if gap <= _TOUCH and rate < 0.0:
            return time
        time += leap(max(gap, _TOUCH), rate, _PADDLE_ACCELERATION)
        if time >= duration:
            break
    return duration
