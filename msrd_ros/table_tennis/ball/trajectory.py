"""Where a ball will be: its path with bounces on the table, and its flight after a hit.

For planning and predicting only. Knows the model's flight and table, but neither net nor paddle; what really
happens to a ball is the rally's business.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.table_tennis.ball.flight import BALL_SIZE, flight_step
from msrd_ros.table_tennis.ball.rebound import rebound_rigid
from msrd_ros.table_tennis.ball.scene import SceneConstants

Array = NDArray[np.float64]

_FLIGHT_STEP_S = 0.005
_LONGEST_FLIGHT_S = 2.5


@njit(cache=True, nogil=True)
def _over_table(ball: Array, scene: SceneConstants) -> bool:
    over: bool = abs(ball[0]) < scene.table_half_length and abs(ball[1]) < scene.table_half_width
    return over


@njit(cache=True, nogil=True)
def _drop_time(ball: Array, height: float, scene: SceneConstants, longest: float) -> float:
    """Seconds until a falling ball's centre is at `height`, which it reaches within `longest`."""
    time, probe = 0.0, ball.copy()
    for _ in range(4):
        step = (height - probe[2]) / min(probe[5], -0.05)
        step = min(max(step, -time), longest - time)
        flight_step(probe, step, scene)
        time += step
    return time


@njit(cache=True, nogil=True)
def ball_path(ball: Array, period: float, count: int, scene: NDArray[np.void]) -> Array:
    """States of a ball at equal periods, bouncing on the table.

    Parameters
    ----------
    ball
        State now (9,): position, velocity, spin; SI.
    period
        Seconds between the states; below the time between two bounces.
    count
        How many states, the first being `ball` itself.
    scene
        `Scene.constants()`.

    Returns
    -------
    Array
        Shape (count, 9).
    """
    constants = scene[0]
    height = constants.table_top + constants.ball_radius
    path = np.empty((count, BALL_SIZE))
    copy_onto(path[0], ball)
    here = ball.copy()
    before = ball.copy()
    for index in range(1, count):
        copy_onto(before, here)
        flight_step(here, period, constants)
        if here[2] < height <= before[2] and _over_table(here, constants):
            fall = _drop_time(before, height, constants, period)
            copy_onto(here, before)
            flight_step(here, fall, constants)
            rebound_rigid(
                here,
                0.0,
                0.0,
                1.0,
                constants.table_restitution,
                constants.table_friction,
                constants,
            )
            flight_step(here, period - fall, constants)
        copy_onto(path[index], here)
    return path


@njit(cache=True, nogil=True)
def path_at(path: Array, period: float, time: float) -> Array:
    """State (9,) at `time` seconds after the first row of a path, linear between its rows."""
    place = min(max(time / period, 0.0), path.shape[0] - 1.001)
    index = int(place)
    share = place - index
    state: Array = path[index] * (1.0 - share) + path[index + 1] * share
    return state


class ReturnFlight(NamedTuple):
    """How a struck ball flies: where its centre comes down to the table's height, SI.

    `net_height` and `apex` are heights of the centre over the net line and at the top; `net_height` is NaN
    when the ball comes down before the net line.
    """

    landing_x: float
    landing_y: float
    net_height: float
    apex: float
    duration: float


@njit(cache=True, nogil=True)
def return_flight(ball: Array, scene: NDArray[np.void]) -> ReturnFlight:
    """Fly a struck ball (9,) down to the height of the table, through the net if it is in the way."""
    constants = scene[0]
    height = constants.table_top + constants.ball_radius
    here, before = ball.copy(), ball.copy()
    time, apex, net_height = 0.0, ball[2], np.nan
    while time < _LONGEST_FLIGHT_S:
        copy_onto(before, here)
        flight_step(here, _FLIGHT_STEP_S, constants)
        if before[0] < 0.0 <= here[0]:
            share = -before[0] / (here[0] - before[0])
            net_height = before[2] + share * (here[2] - before[2])
        apex = max(apex, here[2])
        if here[2] < height and here[5] < 0.0:
            fall = _drop_time(before, height, constants, _FLIGHT_STEP_S) if before[2] > height else 0.0
            flight_step(before, fall, constants)
            return ReturnFlight(before[0], before[1], net_height, apex, time + fall)
        time += _FLIGHT_STEP_S
    return ReturnFlight(here[0], here[1], net_height, apex, time)
