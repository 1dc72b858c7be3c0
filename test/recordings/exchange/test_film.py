"""Pictures of strokes: one a row, where the table of episodes says, of recorded joints and ball."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from edited_bags import shipped
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import Episode
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.exchange.film import FEATURE, Film
from msrd_ros.recordings.exchange.lerobot_writer import EpisodeVideo
from msrd_ros.table_tennis.simulation.render import FilmStudio
from sawyer import ROBOT

RATE_HZ, ROWS = 50, 4


@pytest.fixture(scope="module")
def strokes() -> list[Episode]:
    """The beginning of a stroke, and what follows."""
    (episode,) = read_episodes(Bag(shipped()))
    return [_part(episode, begin) for begin in (0, 45)]


def _part(episode: Episode, begin: int) -> Episode:
    rows = slice(begin, begin + ROWS + 1)
    return Episode(
        episode.label,
        episode.joint_position[rows],
        episode.joint_velocity[rows],
        episode.ball_position[rows],
        episode.ball_velocity[rows],
    )


def film(root: Path, strokes: list[Episode], file_mb: float) -> list[EpisodeVideo]:
    """Film the strokes."""
    with Film(root, ROBOT, RATE_HZ, file_mb) as camera:
        return [camera.add(stroke) for stroke in strokes]


def pictures(root: Path, number: int) -> NDArray[np.uint8]:
    """All pictures of a file."""
    with av.open(str(root / "videos" / FEATURE / "chunk-000" / f"file-{number:03d}.mp4")) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.average_rate == Fraction(RATE_HZ)
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def apart(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Share of pixels of plainly another colour."""
    return float((np.abs(one.astype(int) - other).max(axis=2) > 40).mean())


def test_pictures_are_those_of_the_rows(strokes: list[Episode], tmp_path: Path) -> None:
    told = film(tmp_path, strokes, 100.0)
    assert [(one.file_index, one.from_s, one.to_s) for one in told] == [(0, 0.0, 0.08), (0, 0.08, 0.16)]
    found = pictures(tmp_path, 0)
    assert len(found) == 2 * ROWS
    with FilmStudio(ROBOT) as studio:
        for number, stroke in enumerate(strokes):
            drawn = studio.frame(stroke.joint_position[2], stroke.ball_position[:3])
            own, other = found[number * ROWS + 2], found[(1 - number) * ROWS + 2]
            assert apart(own, drawn) < 0.02 < apart(other, drawn)


def test_a_full_file_is_followed_by_another(strokes: list[Episode], tmp_path: Path) -> None:
    told = film(tmp_path, strokes, 0.0)
    assert [(one.file_index, one.from_s) for one in told] == [(0, 0.0), (1, 0.0)]
    assert [len(pictures(tmp_path, number)) for number in (0, 1)] == [ROWS, ROWS]
