"""A stroke as a strip of pictures around the hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.table_tennis.simulation.render import film_frames, film_strip

FILM_OFFSETS_S = (-0.36, -0.14, -0.04, 0.0, 0.10, 0.32)
"""Frames of a film strip, relative to the hit."""


def film_of(episode: Episode) -> NDArray[np.uint8]:
    """A strip of frames around the hit, pixels (height, width, 3)."""
    hit_s = 0.94
    if episode.outcome is not None and episode.outcome.struck:
        hit_s = episode.outcome.hit_time_s
    last = len(episode.joint_position) - 1
    at = [min(max(round((hit_s + offset) / CONTROL_PERIOD_S), 0), last) for offset in FILM_OFFSETS_S]
    return film_strip(
        film_frames(episode.robot, episode.joint_position, episode.ball_position, at), columns=3
    )
