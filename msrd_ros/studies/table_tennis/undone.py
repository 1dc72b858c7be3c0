"""Demonstrations with the return undone: the ball flies on as if nobody had touched it.

The paper compares the task reward of its demonstrations with that of the same demonstrations in which the
ball was not returned. The launch is fitted to what the camera saw before the hit and flown on with the
model of flight and bounces; the arm moves as it did.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.estimator import FlightEstimator
from msrd_ros.table_tennis.ball.referee import new_referees
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE

_STEPS_PER_TICK = 4
_FIT_STEPS = 8


def undo_return(episode: Episode, camera_noise_m: float, rng: np.random.Generator) -> Episode:
    """The same stroke with a ball that nobody touches.

    Parameters
    ----------
    episode
        With an outcome that says when the ball was hit.
    camera_noise_m
        With which the ball is seen after the hit, as before it; 0 for none.
    rng
        Of that noise.

    Raises
    ------
    UserError
        If the episode does not say when the ball was hit.
    """
    if episode.outcome is None or not np.isfinite(episode.outcome.hit_time_s):
        raise UserError(f"{episode.source}: does not say when the ball was hit; record rally/outcome too")
    # Ticks up to one period before the hit: launch and ticks may lie a fraction of a period apart.
    last = int(episode.outcome.hit_time_s / CONTROL_PERIOD_S) - 1
    path, first = untouched_path(episode.ball_position, last)
    position = episode.ball_position.copy()
    seen = path[last + 1 - first :]
    position[last + 1 :] = seen + camera_noise_m * rng.standard_normal(seen.shape)
    velocity = episode.ball_velocity.copy()
    velocity[last + 1 :] = np.diff(position[last:], axis=0) / CONTROL_PERIOD_S
    return replace(episode, ball_position=position, ball_velocity=velocity, outcome=None)


def untouched_path(seen: NDArray[np.float64], last: int) -> tuple[NDArray[np.float64], int]:
    """Path of a ball that nobody touches, fitted to samples before the hit.

    Parameters
    ----------
    seen
        Samples at the control rate, shape (T + 1, 3), m.
    last
        Index of the last sample that counts.

    Returns
    -------
    path
        Positions from the first flying sample to the end, shape (T + 1 - first, 3), m.
    first
        Index of the first flying sample.
    """
    scene = Scene().constants()
    estimator = FlightEstimator(scene)
    first = -1
    for index in range(last + 1):
        estimator.see(index * CONTROL_PERIOD_S, seen[index])
        if first < 0 and estimator.first_seen_s is not None:
            first = index
    ball = estimator.estimate(_FIT_STEPS)
    if ball is None or not np.isfinite(ball).all():
        raise UserError("undone return: too few samples of the ball before the hit")
    ball = ball.copy()
    referees = new_referees(1)
    step = CONTROL_PERIOD_S / _STEPS_PER_TICK
    path = np.empty((len(seen) - first, 3))
    for row in range(len(path)):
        path[row] = ball[:3]
        for part in range(_STEPS_PER_TICK):
            time = row * CONTROL_PERIOD_S + part * step
            step_ball(ball, referees, NO_PADDLE, NO_PADDLE, time, step, scene)
    return path, first
