"""The one step by which balls move in both simulators: flight, touches, rebounds and the referee."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.table_tennis.ball.flight import BALL_SIZE, flight_step
from msrd_ros.table_tennis.ball.impact_time import (
    REST_SPEED,
    fixed_impact,
    may_hit_fixed,
    may_hit_paddle,
    paddle_gap,
    paddle_impact,
)
from msrd_ros.table_tennis.ball.rebound import rebound_rigid, rebound_rubber
from msrd_ros.table_tennis.ball.referee import judge_flight, judge_touch
from msrd_ros.table_tennis.ball.scene import SceneConstants
from msrd_ros.table_tennis.ball.surfaces import FLOOR, NET, NO_CONTACT, PADDLE, TABLE, TABLE_SIDE, fixed_gap

_MOST_TOUCHES = 16
"""In one step: more than a ball at rest in a corner needs, fewer than would hold everyone up."""
_SHORTEST = 1e-12
"""Seconds; what is left of a step below this is nothing."""


@njit(cache=True, nogil=True)
def step_ball(
    ball: NDArray[np.float64],
    referee: NDArray[np.void],
    paddle_start: NDArray[np.float64],
    paddle_end: NDArray[np.float64],
    time: float,
    duration: float,
    scene: NDArray[np.void],
) -> int:
    """Move one ball through one step, in place, and let the referee watch.

    Between touches the ball flies by one Runge-Kutta step, so that steps of up to 5 ms cost no accuracy;
    the paddle moves on the cubic through its two poses and velocities, so that it is the paddle's
    acceleration that asks for short steps when it is near.

    Parameters
    ----------
    ball
        State, shape (9,).
    referee
        `new_referees(1)` or a slice of it, shape (1,).
    paddle_start, paddle_end
        The paddle at both ends of the step, shape (12,), as in `surfaces`; `NO_PADDLE` for none.
    time
        At the start of the step, seconds.
    duration
        Of the step, seconds; at most 5 ms.
    scene
        `Scene.constants()`, shape (1,).

    Returns
    -------
    int
        The surfaces touched, as bits of `surfaces`.
    """
    constants = scene[0]
    umpire = referee[0]
    touched = NO_CONTACT
    elapsed = 0.0
    end = np.empty(BALL_SIZE)
    for _ in range(_MOST_TOUCHES):
        left = duration - elapsed
        if left <= _SHORTEST:
            break
        copy_onto(end, ball)
        flight_step(end, left, constants)
        surface, wait = first_impact(ball, end, left, paddle_start, paddle_end, elapsed, duration, constants)
        if surface == NO_CONTACT:
            copy_onto(ball, end)
            elapsed = duration
            break
        if surface == PADDLE:
            gap, _, nx, ny, nz, sx, sy, sz = paddle_gap(
                ball, end, wait, left, paddle_start, paddle_end, elapsed, duration, constants
            )
            flight_step(ball, wait, constants)
            push_out(ball, gap, nx, ny, nz)
            rebound_rubber(ball, nx, ny, nz, sx, sy, sz, constants)
        else:
            flight_step(ball, wait, constants)
            surface = rebound_fixed(ball, surface, constants)
        elapsed += wait
        touched |= surface
        judge_touch(umpire, surface, ball, time + elapsed)
    if elapsed < duration:
        flight_step(ball, duration - elapsed, constants)
    judge_flight(umpire, ball, time + duration, constants)
    return touched


@njit(cache=True)
def first_impact(
    ball: NDArray[np.float64],
    end: NDArray[np.float64],
    left: float,
    paddle_start: NDArray[np.float64],
    paddle_end: NDArray[np.float64],
    elapsed: float,
    duration: float,
    scene: SceneConstants,
) -> tuple[int, float]:
    """Surface that a ball on its way to `end` touches first, and after how many seconds; or `NO_CONTACT`."""
    surface = NO_CONTACT
    earliest = left
    for candidate in (TABLE, NET, FLOOR):
        if may_hit_fixed(candidate, ball, end, left, scene):
            wait = fixed_impact(candidate, ball, end, left, scene)
            if wait < earliest:
                surface, earliest = candidate, wait
    if may_hit_paddle(ball, end, paddle_start, paddle_end, duration, scene):
        wait = paddle_impact(ball, end, left, paddle_start, paddle_end, elapsed, duration, scene)
        if wait < earliest:
            surface, earliest = PADDLE, wait
    return surface, earliest


@njit(cache=True)
def push_out(ball: NDArray[np.float64], gap: float, nx: float, ny: float, nz: float) -> None:
    """Lift a ball that has sunk into a surface out of it."""
    if gap < 0.0:
        ball[0] -= gap * nx
        ball[1] -= gap * ny
        ball[2] -= gap * nz


@njit(cache=True)
def rebound_fixed(ball: NDArray[np.float64], surface: int, scene: SceneConstants) -> int:
    """Rebound off table, net or floor; returns the surface, with the table's sides told from its top."""
    gap, nx, ny, nz = fixed_gap(surface, ball[0], ball[1], ball[2], scene)
    if surface == TABLE:
        restitution, friction = scene.table_restitution, scene.table_friction
        # The upper edge belongs to the playing surface (ITTF law 2.1.2), the sides below it do not.
        if ball[2] < scene.table_top:
            surface = TABLE_SIDE
    elif surface == NET:
        restitution, friction = scene.net_restitution, 0.0
    else:
        restitution, friction = scene.floor_restitution, scene.floor_friction
    if -(ball[3] * nx + ball[4] * ny + ball[5] * nz) < REST_SPEED:
        restitution = 0.0
    push_out(ball, gap, nx, ny, nz)
    rebound_rigid(ball, nx, ny, nz, restitution, friction, scene)
    return surface
