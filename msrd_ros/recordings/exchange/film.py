"""The simulator's picture of strokes as a LeRobotDataset's video: drawn from joints and ball, no camera's."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from msrd_ros.contract.episode import Episode
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.lerobot_writer import VIDEO_FILE_MB, VIDEO_PATH, EpisodeVideo, numbered
from msrd_ros.recordings.exchange.statistics import picture_statistics
from msrd_ros.robots.robot import Robot

FEATURE = "observation.images.simulator"
CODEC, ENCODER, PIXELS = "h264", "libx264", "yuv420p"
_OPTIONS = {"g": "2", "crf": "23"}
"""A key frame every other frame, as LeRobot has it: frames are read in any order."""


class Film:
    """Draws and encodes the pictures of one stroke after the other; files are whole when it is left.

    Parameters
    ----------
    root
        The data set's folder.
    robot
        The arm to draw.
    rate_hz
        Frames a second.
    file_mb
        Size from which pictures go into a new file.

    Attributes
    ----------
    feature, description
        Name in the data set, and what ``meta/info.json`` says of it.
    """

    feature = FEATURE

    def __init__(self, root: Path, robot: Robot, rate_hz: int, file_mb: float = VIDEO_FILE_MB) -> None:
        try:
            import av

            from msrd_ros.table_tennis.simulation.render import FilmStudio
        except ImportError as error:
            raise UserError(
                f"{error.name} is not installed; pip install 'msrd_ros[lerobot,sim]', or leave out --video"
            ) from None
        self._av: Any = av
        self._studio = FilmStudio(robot)
        style = self._studio.style
        self._root, self._rate_hz, self._file_mb = root, rate_hz, file_mb
        self._file_index, self._frames = 0, 0
        self._container: Any = None
        self._stream: Any = None
        self.description = {
            "dtype": "video",
            "shape": [style.height, style.width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": style.height,
                "video.width": style.width,
                "video.codec": CODEC,
                "video.pix_fmt": PIXELS,
                "video.is_depth_map": False,
                "video.fps": rate_hz,
                "video.channels": 3,
                "has_audio": False,
            },
        }

    def add(self, episode: Episode) -> EpisodeVideo:
        """Draw the rows of a stroke."""
        frames = np.stack(
            [
                self._studio.frame(episode.joint_position[row], episode.ball_position[: row + 1])
                for row in range(len(episode.actions))
            ]
        )
        if self._container is not None and self._path().stat().st_size >= self._file_mb * 2**20:
            self._finish_file()
            self._file_index += 1
        if self._container is None:
            self._open_file()
        begin = self._frames
        for frame in frames:
            picture = self._av.VideoFrame.from_ndarray(frame, format="rgb24")
            picture.pts = self._frames
            self._container.mux(self._stream.encode(picture))
            self._frames += 1
        from_s, to_s = begin / self._rate_hz, self._frames / self._rate_hz
        return EpisodeVideo(FEATURE, self._file_index, from_s, to_s, picture_statistics(frames))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the last file, and leave the simulator."""
        if self._container is not None:
            self._finish_file()
        self._studio.close()

    def _path(self) -> Path:
        folder, _, _ = VIDEO_PATH.partition("/chunk")
        return self._root / folder.format(video_key=FEATURE) / f"{numbered(self._file_index)}.mp4"

    def _open_file(self) -> None:
        self._path().parent.mkdir(parents=True, exist_ok=True)
        self._container = self._av.open(str(self._path()), "w")
        self._stream = self._container.add_stream(ENCODER, rate=self._rate_hz, options=_OPTIONS)
        self._stream.width, self._stream.height = self._studio.style.width, self._studio.style.height
        self._stream.pix_fmt = PIXELS
        self._frames = 0

    def _finish_file(self) -> None:
        self._container.mux(self._stream.encode())
        self._container.close()
        self._container = None
