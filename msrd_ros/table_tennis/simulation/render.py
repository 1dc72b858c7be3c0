"""Film strips of strokes, drawn by Bullet's software renderer from recorded joints and ball positions.

Needs no display. The ball and its trail are painted over the picture, a little larger than life, so that
they can be seen in small frames; what is behind robot, table or net is painted faintly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import End
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.bullet_arm import BulletArm
from msrd_ros.table_tennis.simulation.bullet_scene import BulletScene

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
"""Height x width x 3, red, green and blue."""
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class FilmStyle:
    """Camera, light and paint of a film.

    Attributes
    ----------
    width, height
        Of a frame in pixels.
    eye, target
        Where the camera stands and where it looks, m.
    view_angle_deg
        Of the camera, vertically.
    supersampling
        Pixels drawn along each side of one pixel shown; smooths edges.
    light
        Direction towards the light.
    ball_pixels
        Smallest radius of the painted ball, for frames 320 pixels wide.
    trail_steps
        How many earlier ball positions the trail shows.
    ball_colour, trail_colour, sky_top, sky_bottom
        Red, green and blue, 0 to 255.
    """

    width: int = 320
    height: int = 240
    eye: Vector = (0.9, -3.4, 2.0)
    target: Vector = (-0.72, 0.0, 0.90)
    view_angle_deg: float = 34.0
    supersampling: int = 2
    light: Vector = (2.0, -3.0, 4.0)
    ball_pixels: float = 3.2
    trail_steps: int = 60
    ball_colour: Vector = (255.0, 150.0, 20.0)
    trail_colour: Vector = (222.0, 92.0, 0.0)
    sky_top: Vector = (205.0, 216.0, 228.0)
    sky_bottom: Vector = (243.0, 244.0, 245.0)


_NEAR_M, _FAR_M = 0.3, 400.0
_HIDDEN_SHARE = 0.25
"""How strongly things behind others are painted."""


class FilmStudio:
    """Robot, table and camera for drawing frames; keep it for many frames, setting it up takes time.

    Parameters
    ----------
    robot
        Which arm, of N joints.
    scene
        Sizes of table, net and ball.
    style
        Of the pictures.
    both_ends
        Whether another such arm stands at the far end.
    """

    def __init__(
        self,
        robot: Robot,
        scene: Scene | None = None,
        style: FilmStyle | None = None,
        both_ends: bool = False,
    ) -> None:
        self._scene = scene or Scene()
        self.style = style or FilmStyle()
        self._client: int = pybullet.connect(pybullet.DIRECT)
        BulletScene(self._client, self._scene, visible=True, feeder=not both_ends)
        self._arm = BulletArm(self._client, robot)
        self._far_arm = BulletArm(self._client, robot, end=End.FAR) if both_ends else None
        style = self.style
        self._view = pybullet.computeViewMatrix(style.eye, style.target, (0.0, 0.0, 1.0))
        self._lens = pybullet.computeProjectionMatrixFOV(
            style.view_angle_deg, style.width / style.height, _NEAR_M, _FAR_M
        )
        matrices = [np.array(matrix).reshape(4, 4).T for matrix in (self._lens, self._view)]
        self._to_clip: Array = matrices[0] @ matrices[1]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave Bullet."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def frame(
        self, joint_position: Array, ball_path: Array, far_joint_position: Array | None = None
    ) -> Image:
        """One picture.

        Parameters
        ----------
        joint_position
            Shape (N,), rad.
        ball_path
            The ball now (last row) and before, shape (N, 3), m; rows that are not finite are left out, an
            empty path is no ball.
        far_joint_position
            Of the arm at the far end, if there is one, shape (N,), rad.
        """
        self._arm.place(np.asarray(joint_position, dtype=np.float64))
        if self._far_arm is not None and far_joint_position is not None:
            self._far_arm.place(np.asarray(far_joint_position, dtype=np.float64))
        canvas = self._photograph()
        path = np.asarray(ball_path, dtype=np.float64).reshape(-1, 3)[-self.style.trail_steps - 1 :]
        if len(path) and np.isfinite(path[-1]).all():
            self._paint_shadow(canvas, path[-1])
        self._paint_trail(canvas, path)
        size = self.style.supersampling
        shape = (self.style.height, size, self.style.width, size, 3)
        pixels: NDArray[np.uint8] = (
            canvas.pixels.reshape(shape).mean(axis=(1, 3)).round().clip(0, 255).astype(np.uint8)
        )
        return pixels

    def _photograph(self) -> _Canvas:
        style = self.style
        width, height = style.width * style.supersampling, style.height * style.supersampling
        _, _, colours, depth, bodies = pybullet.getCameraImage(
            width,
            height,
            self._view,
            self._lens,
            renderer=pybullet.ER_TINY_RENDERER,
            shadow=0,
            lightDirection=style.light,
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.50,
            lightSpecularCoeff=0.12,
            physicsClientId=self._client,
        )
        pixels = np.array(colours, dtype=np.float64).reshape(height, width, 4)[:, :, :3]
        empty = np.asarray(bodies).reshape(height, width) < 0
        shade = np.linspace(0.0, 1.0, height)[:, None]
        sky = np.array(style.sky_top) * (1.0 - shade) + np.array(style.sky_bottom) * shade
        pixels[empty] = np.broadcast_to(sky[:, None, :], pixels.shape)[empty]
        return _Canvas(pixels, np.asarray(depth, dtype=np.float64).reshape(height, width))

    def _project(self, position: Array) -> tuple[float, float, float, float]:
        """Column, row, depth (as in the depth buffer) and pixels per metre of a point (3,)."""
        clip = self._to_clip @ np.append(position, 1.0)
        x, y, z = clip[:3] / clip[3]
        size = self.style.supersampling
        column = (x + 1.0) / 2.0 * self.style.width * size
        row = (1.0 - y) / 2.0 * self.style.height * size
        scale = self._to_clip[1, :3] @ self._to_clip[1, :3]
        return column, row, (z + 1.0) / 2.0, float(np.sqrt(scale)) / clip[3] * self.style.height * size / 2.0

    def _paint_trail(self, canvas: _Canvas, path: Array) -> None:
        style = self.style
        least = style.ball_pixels * style.supersampling * style.width / 320.0
        colour, trail = np.array(style.ball_colour), np.array(style.trail_colour)
        for index, position in enumerate(path):
            if not np.isfinite(position).all():
                continue
            column, row, depth, scale = self._project(position)
            radius = max(self._scene.ball.radius_m * scale, least)
            age = (len(path) - 1 - index) / max(style.trail_steps, 1)
            if index == len(path) - 1:
                canvas.disc(column, row, depth, 1.28 * radius, np.array([60.0, 30.0, 0.0]), 0.85)
                canvas.disc(column, row, depth, radius, colour, 1.0)
                canvas.disc(
                    column - 0.3 * radius,
                    row - 0.3 * radius,
                    depth,
                    0.38 * radius,
                    np.array([255.0, 235.0, 200.0]),
                    0.9,
                )
            else:
                canvas.disc(column, row, depth, 0.45 * radius, trail, 1.0 - 0.7 * age)

    def _paint_shadow(self, canvas: _Canvas, ball: Array) -> None:
        """A spot under the ball, on table or floor: shows how high the ball is."""
        table = self._scene.table
        over_table = abs(ball[0]) < table.length_m / 2 and abs(ball[1]) < table.width_m / 2
        ground = table.height_m if over_table and ball[2] > table.height_m else 0.0
        column, row, depth, scale = self._project(np.array([ball[0], ball[1], ground]))
        least = self.style.ball_pixels * self.style.supersampling * self.style.width / 320.0
        radius = max(self._scene.ball.radius_m * scale, least)
        canvas.disc(column, row, depth - 1e-4, radius, np.zeros(3), 0.30, flatness=0.45)


@dataclass
class _Canvas:
    """A picture that is being painted: pixels (H, W, 3) and the depth buffer (H, W)."""

    pixels: Array
    depth: Array = field(repr=False)

    def disc(
        self,
        column: float,
        row: float,
        depth: float,
        radius: float,
        colour: Array,
        strength: float,
        flatness: float = 1.0,
    ) -> None:
        """Blend a disc in, faintly where something nearer is in front of it."""
        height, width = self.depth.shape
        top, bottom = max(int(row - radius) - 1, 0), min(int(row + radius) + 2, height)
        left, right = max(int(column - radius) - 1, 0), min(int(column + radius) + 2, width)
        if top >= bottom or left >= right:
            return
        rows = (np.arange(top, bottom)[:, None] + 0.5 - row) / flatness
        columns = np.arange(left, right)[None, :] + 0.5 - column
        cover = np.clip(radius - np.sqrt(rows**2 + columns**2) + 0.5, 0.0, 1.0) * strength
        hidden = self.depth[top:bottom, left:right] < depth - 2e-4
        cover = np.where(hidden, _HIDDEN_SHARE * cover, cover)[:, :, None]
        patch = self.pixels[top:bottom, left:right]
        patch += cover * (colour - patch)


def film_frames(
    robot: Robot,
    joint_positions: Array,
    ball_positions: Array,
    at: Sequence[int] | None = None,
    *,
    scene: Scene | None = None,
    style: FilmStyle | None = None,
) -> list[Image]:
    """Frames of a recorded stroke.

    Parameters
    ----------
    robot
        Which arm.
    joint_positions, ball_positions
        Recorded at the same times, shapes (T, N) in rad and (T, 3) in m.
    at
        Which samples to draw; all by default. The trail runs through all samples before.
    scene, style
        What to draw and how.

    Returns
    -------
    list of Image
        As many as `at` names.
    """
    wanted = range(len(joint_positions)) if at is None else at
    with FilmStudio(robot, scene, style) as studio:
        return [studio.frame(joint_positions[index], ball_positions[: index + 1]) for index in wanted]


def film_strip(frames: Sequence[Image], gap: int = 3, columns: int | None = None) -> Image:
    """Put frames side by side, in rows of `columns` (all in one row by default), with white gaps (pixels)."""
    columns = columns or len(frames)
    height, width, _ = frames[0].shape
    rows = -(-len(frames) // columns)
    strip = np.full((rows * (height + gap) - gap, columns * (width + gap) - gap, 3), 255, dtype=np.uint8)
    for index, frame in enumerate(frames):
        top, left = index // columns * (height + gap), index % columns * (width + gap)
        strip[top : top + height, left : left + width] = frame
    return strip
