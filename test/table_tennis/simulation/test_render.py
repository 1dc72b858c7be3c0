"""Film strips: the ball is seen where it is, and the pictures are whole."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.simulation.render import FilmStudio, FilmStyle, film_frames, film_strip
from sawyer import HOME_POSTURE_RAD, ROBOT

pytestmark = pytest.mark.slow

SMALL = FilmStyle(width=160, height=120)
BALLS = np.array([[0.5, 0.0, 1.15], [0.0, 0.0, 1.25], [-0.9, -0.1, 0.9]])


def _ball_column(frame: np.ndarray, without: np.ndarray) -> float:
    """Where in the picture the ball was painted, as the mean column of what it changed."""
    changed = np.abs(frame.astype(int) - without.astype(int)).sum(axis=2)
    return float((changed.sum(axis=0) * np.arange(frame.shape[1])).sum() / changed.sum())


def test_the_ball_moves_through_the_picture_towards_the_robot() -> None:
    with FilmStudio(ROBOT, style=SMALL) as studio:
        empty = studio.frame(HOME_POSTURE_RAD, np.empty((0, 3)))
        columns = [_ball_column(studio.frame(HOME_POSTURE_RAD, ball[None]), empty) for ball in BALLS]
    assert columns[0] > columns[1] + 10
    assert columns[1] > columns[2] + 10


def test_the_trail_shows_where_the_ball_has_been_and_gaps_are_left_out() -> None:
    gap = BALLS.copy()
    gap[1] = np.nan
    joints = np.tile(HOME_POSTURE_RAD, (3, 1))
    with FilmStudio(ROBOT, style=SMALL) as studio:
        alone = studio.frame(HOME_POSTURE_RAD, BALLS[2:])
    whole = film_frames(ROBOT, joints, BALLS, style=SMALL)[2]
    broken = film_frames(ROBOT, joints, gap, [2], style=SMALL)[0]
    painted = [int((frame != alone).any(axis=2).sum()) for frame in (whole, broken)]
    assert painted[0] > painted[1] > 0


def test_the_robot_moves_in_the_picture() -> None:
    joints = np.stack([HOME_POSTURE_RAD, HOME_POSTURE_RAD + 0.3])
    frames = film_frames(ROBOT, joints, np.full((2, 3), np.nan), style=SMALL)
    assert frames[0].shape == (120, 160, 3)
    assert frames[0].dtype == np.uint8
    changed = (frames[0] != frames[1]).any(axis=2)
    assert 100 < changed.sum() < 6000


def test_a_strip_holds_all_frames_in_rows() -> None:
    frames = [np.full((4, 6, 3), shade, dtype=np.uint8) for shade in (10, 20, 30)]
    strip = film_strip(frames, gap=2)
    assert strip.shape == (4, 22, 3)
    np.testing.assert_array_equal(strip[:, 8:14], frames[1])
    assert (strip[:, 6:8] == 255).all()
    rows = film_strip(frames, gap=2, columns=2)
    assert rows.shape == (10, 14, 3)
    np.testing.assert_array_equal(rows[6:, :6], frames[2])
