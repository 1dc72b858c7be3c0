"""When the ball first touches something within a step.

The first touch is found by leaps that can never pass it: with the gap g, its rate g' and a bound A on how
fast that rate can fall, no touch can come before the root of g + g' t - A t^2 / 2. For a ball heading for a
surface this is Newton's method, for one that passes by it is one long leap; nothing is sampled, so nothing
is tunnelled through.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.scene import SceneConstants
from msrd_ros.table_tennis.ball.surfaces import NET, TABLE, blade_gap, fixed_gap

_FIXED_ACCELERATION = 400.0
"""Bound A for surfaces at rest, m/s^2: a ball in flight at 25 m/s and 500 rad/s stays below 150."""
_PADDLE_ACCELERATION = 4000.0
"""Bound A for the paddle: a blade at 12 m/s and 30 rad/s with 200 m/s^2 stays below 2,000."""
_AT_IMPACT = 1e-7
"""Gap in m that counts as a touch."""
REST_SPEED = 0.02
"""Approach in m/s below which a ball does not bounce off a surface at rest any more, but rests on it."""
_REST_DEPTH = 1e-5
"""What a resting ball sinks in, in m, before it is held up: so that it touches a few times a step, not
hundreds."""
_MOST_LEAPS = 1000


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
def leap(gap: float, rate: float, acceleration: float) -> float:
    """Seconds within which a gap with this rate cannot close: root of gap + rate t - acceleration t^2 / 2."""
    return 2.0 * gap / (math.sqrt(rate * rate + 2.0 * acceleration * gap) - rate)


@njit(cache=True)
def may_hit_fixed(
    surface: int,
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    duration: float,
    scene: SceneConstants,
) -> bool:
    """Whether a ball comes near a surface at all: a cheap test that spares most steps the search."""
    # Between the ends the path bulges by no more than A / 8 duration^2.
    skin = scene.ball_radius + 0.125 * _FIXED_ACCELERATION * duration * duration
    near: bool
    if surface == TABLE:
        near = min(ball[2], ball_end[2]) < scene.table_top + skin
    elif surface == NET:
        reach = scene.net_half_thickness + skin
        near = min(ball[0], ball_end[0]) < reach and max(ball[0], ball_end[0]) > -reach
    else:
        near = min(ball[2], ball_end[2]) < skin
    return near


@njit(cache=True)
def may_hit_paddle(
    ball: NDArray[np.float64],
    ball_end: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    span: float,
    scene: SceneConstants,
) -> bool:
    """Whether ball and blade come near each other at all; see `may_hit_fixed`."""
    reach = scene.ball_radius + scene.blade_radius + scene.blade_half_thickness
    distance_squared = 0.0
    for axis in range(3):
        distance_squared += (ball[axis] - start[axis]) ** 2
        # Twice what both move along this axis, and so more than any bulge of their paths.
        reach += 2.0 * abs(ball_end[axis] - ball[axis]) + span * abs(ball[3 + axis] - ball_end[3 + axis])
        reach += abs(end[axis] - start[axis]) + span * (abs(start[6 + axis]) + abs(end[6 + axis]))
    return distance_squared < reach * reach


@njit(cache=True)
def fixed_impact(
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
        if gap <= (_AT_IMPACT if rate < -REST_SPEED else -_REST_DEPTH) and rate < 0.0:
            return time
        time += leap(max(gap, _AT_IMPACT), rate, _FIXED_ACCELERATION)
        if time >= duration:
            break
    return duration


@njit(cache=True)
def paddle_impact(
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
        if gap <= _AT_IMPACT and rate < 0.0:
            return time
        time += leap(max(gap, _AT_IMPACT), rate, _PADDLE_ACCELERATION)
        if time >= duration:
            break
    return duration
