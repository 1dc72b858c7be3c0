"""Which strokes stand out from the others of their label.

Jerk and distance are judged leave-one-out: each stroke against the other accepted ones of its label, never
against itself. A deviation is the difference from their median over 1.4826 times their median absolute
deviation, so that some outliers among them hide neither each other nor themselves. Source: B. Iglewicz,
D. Hoaglin, How to Detect and Handle Outliers, 1993.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.cdr import read_stamp_ns
from msrd_ros.bags.strokes import STATES, Stroke
from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, Episode

Array = NDArray[np.float64]

_MAD_TO_SIGMA = 1.4826
_GAP = 1.5
"""A step between stamps that is so many times the usual one has samples missing in it."""


@dataclass(frozen=True)
class OutlierLimits:
    """From where on a stroke is marked.

    Attributes
    ----------
    deviation
        Robust standard score of jerk and of distance, above the others.
    fewest
        With fewer others of a label nothing is said about either.
    least_spread
        The spread of the others counts as at least this share of their median: strokes that a program led
        are alike to the last digit, and a small difference is none that a person would call one.
    missed_share
        Share of a topic's samples that are missing in flight.
    """

    deviation: float = 5.0
    fewest: int = 4
    least_spread: float = 0.2
    missed_share: float = 0.02


def rms_jerk(episode: Episode) -> float:
    """Root mean square over the acting steps of the norm of all joints' jerk, rad/s^3.

    From the measured joint velocities at the control rate, by second differences.
    """
    velocity = episode.joint_velocity[: ACTING_STEPS + 1]
    jerk = np.diff(velocity, n=2, axis=0) / CONTROL_PERIOD_S**2
    return float(np.sqrt((jerk**2).sum(axis=1).mean()))


def path_of(episode: Episode) -> Array:
    """A stroke in the space in which strokes are compared, (ACTING_STEPS + 1, N).

    Joint angles in rad at the control rate, from the ball's launch until the arm comes to rest.
    """
    return episode.joint_position[: ACTING_STEPS + 1]


def distances(paths: Sequence[Array], among: Sequence[int]) -> Array:
    """How far each path is from the median path of the others, rad: (K,).

    Parameters
    ----------
    paths
        K of them, (T, N) each.
    among
        Numbers of those that the others are taken from; each is left out where it is itself measured.

    Returns
    -------
    Root mean square over time of the norm over joints; NaN where there are no others.
    """
    found = np.full(len(paths), np.nan)
    stacked = np.array(paths)
    for number, path in enumerate(paths):
        others = [other for other in among if other != number]
        if others:
            apart = path - np.median(stacked[others], axis=0)
            found[number] = np.sqrt((apart**2).sum(axis=1).mean())
    return found


def deviations(values: Array, among: Sequence[int], limits: OutlierLimits) -> Array:
    """Robust standard scores (K,) of values (K,) against the others; NaN where these are too few.

    Parameters
    ----------
    values
        One a stroke.
    among
        Numbers of those that the others are taken from.
    limits
        How many they have to be, and their least spread.
    """
    found = np.full(len(values), np.nan)
    for number, value in enumerate(values):
        others = values[[other for other in among if other != number]]
        if len(others) >= limits.fewest:
            middle = float(np.median(others))
            spread = _MAD_TO_SIGMA * float(np.median(np.abs(others - middle)))
            least = limits.least_spread * abs(middle)
            if max(spread, least) > 0.0:
                found[number] = (value - middle) / max(spread, least)
    return found


def missed_samples(stroke: Stroke) -> dict[str, tuple[int, int]]:
    """How many samples are missing in flight, and how many there would be, by topic.

    By the stamps' usual spacing, their median; where messages have no stamps, by times of reception.
    """
    found = {}
    for role in STATES:
        times = [
            (read_stamp_ns(message.data) or received_ns)
            for message, received_ns in zip(stroke.messages, stroke.received_ns, strict=True)
            if message.topic == role and message.log_time_ns >= stroke.launch_ns
        ]
        steps = np.diff(np.unique(np.array(times, dtype=np.int64))).astype(np.float64)
        if steps.size:
            usual = float(np.median(steps))
            missing = int(np.round(steps[steps > _GAP * usual] / usual - 1.0).sum())
            found[role] = (missing, steps.size + 1 + missing)
    return found
