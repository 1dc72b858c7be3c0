"""The scene that browsers draw: table, net, arm, ball with its trail and the axis of its spin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from msrd_ros.robots.kinematics import link_frames
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.studio.outlines import arm_meshes
from msrd_ros.studio.private_viser import PrivateViser
from msrd_ros.table_tennis.ball.scene import Scene

Array = NDArray[np.float64]

TRAIL_POINTS = 60
_TABLE_BLUE, _LINE_WHITE, _FLOOR = (18, 62, 110), (235, 235, 235), (226, 229, 233)
_TARGET_GREEN, _TARGET_RADIUS_M, _TARGET_HEIGHT_M = (26, 190, 76), 0.1, 0.004
_BALL_ORANGE, _TRAIL, _SPIN = (255, 128, 0), (255, 150, 50), (120, 40, 200)
_SKY, _GROUND, _SKY_INTENSITY = (255, 255, 255), (200, 195, 190), 1.6
_FLAT: Any = "toon5"
"""Of what has even faces: looks alike, and costs a browser without a graphics processor less."""
_LINE_M = 0.02
_SPIN_LENGTH_M = 0.15
"""Of the arrow at 100 rad/s."""
_SEEN_RAD, _SEEN_M, _SEEN_RAD_S = 5e-4, 1e-3, 1.0
"""What moves less is not seen to move, and is not sent: a browser draws all anew for each message."""
_CAMERA, _LOOK_AT = (-3.3, -2.2, 1.95), (-0.85, 0.05, 0.85)


class Picture(NamedTuple):
    """What is to be seen now; None and no rows for what is not there.

    Attributes
    ----------
    joint_position
        (N,) in rad.
    ball
        (3,) in m.
    trail
        Where the ball was, oldest first, (K, 3) in m.
    spin
        (3,) in rad/s.
    target
        Where the next ball is to land, (2,) in m.
    """

    joint_position: Array | None
    ball: Array | None
    trail: Array
    spin: Array | None
    target: Array | None = None


class LaidPath(NamedTuple):
    """A stroke as lines.

    Attributes
    ----------
    ball, paddle
        Where they were, (T, 3) in m.
    colours
        One for all, (3,), or one for each end of each segment, (T - 1, 2, 3); 0 to 255.
    """

    ball: Array
    paddle: Array
    colours: NDArray[np.uint8]


class TableScene:
    """Draws pictures for all browsers at once.

    Parameters
    ----------
    robot
        Whose outlines are shown.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.viser = PrivateViser()
        scene, facts = self.viser.server.scene, Scene()
        self.viser.server.gui.configure_theme(show_logo=False, show_share_button=False)
        # Shadows, and light from all around, cost a browser without a graphics processor most of its frames.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/sky", sky_color=_SKY, ground_color=_GROUND, intensity=_SKY_INTENSITY)
        self.viser.server.initial_camera.position = _CAMERA
        self.viser.server.initial_camera.look_at = _LOOK_AT
        self._furnish(facts)
        self._links = {
            name: scene.add_mesh_trimesh(f"/arm/{name}", mesh) for name, mesh in arm_meshes(robot).items()
        }
        self._ball = scene.add_icosphere(
            "/ball", facts.ball.radius_m, color=_BALL_ORANGE, subdivisions=2, visible=False
        )
        nothing = np.zeros((TRAIL_POINTS, 2, 3), np.float32)
        self._trail = scene.add_line_segments("/trail", nothing, _TRAIL, thickness=0.012, visible=False)
        self._spin = scene.add_arrows(
            "/ball/spin",
            np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, _SPIN_LENGTH_M]]], np.float32),
            _SPIN,
            shaft_radius=0.006,
            head_radius=0.018,
            head_length=0.04,
            visible=False,
        )
        disc = trimesh.creation.cylinder(_TARGET_RADIUS_M, _TARGET_HEIGHT_M)
        self._target = scene.add_mesh_simple(
            "/target", disc.vertices, disc.faces, color=_TARGET_GREEN, visible=False
        )
        self._target_z_m = facts.table.height_m + _TARGET_HEIGHT_M
        self._laid: list[Any] = []
        self._drawn: dict[str, NDArray[Any] | None] = {}
        self.show(Picture(robot.home_rad, None, np.empty((0, 3)), None))

    def close(self) -> None:
        """Show nothing more."""
        self.viser.close()

    def show(self, picture: Picture) -> None:
        """Draw what is seen to have changed."""
        with self.viser.server.atomic():
            if self._is_news("arm", picture.joint_position, _SEEN_RAD) and picture.joint_position is not None:
                self._show_arm(picture.joint_position)
            self._ball.visible = picture.ball is not None
            if self._is_news("ball", picture.ball, _SEEN_M) and picture.ball is not None:
                self._ball.position = picture.ball
            trail = segments(picture.trail, TRAIL_POINTS) if len(picture.trail) > 1 else None
            self._trail.visible = trail is not None
            if self._is_news("trail", trail, _SEEN_M) and trail is not None:
                self._trail.points = trail
            self._target.visible = picture.target is not None
            if self._is_news("target", picture.target, _SEEN_M) and picture.target is not None:
                self._target.position = np.array([*picture.target, self._target_z_m])
            if self._is_news("spin", picture.spin, _SEEN_RAD_S):
                self._show_spin(picture.spin)

    def _is_news(self, what: str, now: NDArray[Any] | None, seen: float) -> bool:
        """Whether something differs by that much from what was drawn last; it is taken for drawn then."""
        before = self._drawn.get(what)
        if before is not None and now is not None and np.abs(now - before).max() <= seen:
            return False
        self._drawn[what] = now
        return True

    def lay_over(self, paths: Sequence[LaidPath]) -> None:
        """Draw paths over each other, in place of those before."""
        for handle in self._laid:
            handle.remove()
        self._laid = []
        for number, path in enumerate(paths):
            for name, points, thickness in (("ball", path.ball, 0.01), ("paddle", path.paddle, 0.018)):
                self._laid.append(
                    self.viser.server.scene.add_line_segments(
                        f"/laid/{number}/{name}", segments(points), path.colours, thickness=thickness
                    )
                )

    def _show_arm(self, joint_position: Array) -> None:
        positions, rotations = link_frames(self._robot.model, joint_position)
        for name, position, rotation in zip(self._robot.link_names, positions, rotations, strict=True):
            if name in self._links:
                self._links[name].position = position
                self._links[name].wxyz = np.roll(quaternion_from_rotation(rotation), 1)

    def _show_spin(self, spin: Array | None) -> None:
        size = 0.0 if spin is None else float(np.linalg.norm(spin))
        self._spin.visible = size > 1.0
        if spin is not None and size > 1.0:
            self._spin.wxyz = _turn_from_z(spin / size)
            self._spin.scale = size / 100.0

    def _furnish(self, facts: Scene) -> None:
        scene, table, net = self.viser.server.scene, facts.table, facts.net
        scene.add_box(
            "/floor", material=_FLAT, color=_FLOOR, dimensions=(9.0, 6.0, 0.01), position=(-0.3, 0.0, -0.006)
        )
        scene.add_box(
            "/table",
            material=_FLAT,
            color=_TABLE_BLUE,
            dimensions=(table.length_m, table.width_m, table.thickness_m),
            position=(0.0, 0.0, table.height_m - table.thickness_m / 2),
        )
        for name, size, place in _table_lines(table.length_m, table.width_m):
            scene.add_box(
                f"/table_lines/{name}",
                material=_FLAT,
                color=_LINE_WHITE,
                dimensions=(*size, 0.001),
                position=(*place, table.height_m),
            )
        for x in (-1.0, 1.0):
            for y in (-1.0, 1.0):
                scene.add_box(
                    f"/table_legs/{x:g}_{y:g}".replace("-", "m"),
                    material=_FLAT,
                    color=(60, 64, 70),
                    dimensions=(0.06, 0.06, table.height_m - table.thickness_m),
                    position=(
                        x * (table.length_m / 2 - 0.25),
                        y * (table.width_m / 2 - 0.15),
                        (table.height_m - table.thickness_m) / 2,
                    ),
                )
        scene.add_box(
            "/net",
            color=_LINE_WHITE,
            opacity=0.55,
            dimensions=(net.thickness_m, table.width_m + 2 * net.overhang_m, net.height_m),
            position=(0.0, 0.0, table.height_m + net.height_m / 2),
        )


def segments(points: Array, count: int | None = None) -> NDArray[np.float32]:
    """A path (T, 3) as a line, (K, 2, 3): from each point to the next, or `count` evenly chosen pieces."""
    last = len(points) - 1
    rows = points[np.linspace(0, last, (last if count is None else count) + 1).round().astype(int)]
    return np.stack([rows[:-1], rows[1:]], axis=1).astype(np.float32)


def _table_lines(length: float, width: float) -> list[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Name, size and place of each line on the table, x before y, in m."""
    across, along = (_LINE_M, width), (length, _LINE_M)
    half_length, half_width = (length - _LINE_M) / 2, (width - _LINE_M) / 2
    return [
        ("near", across, (-half_length, 0.0)),
        ("far", across, (half_length, 0.0)),
        ("left", along, (0.0, half_width)),
        ("right", along, (0.0, -half_width)),
        ("middle", (length, 0.003), (0.0, 0.0)),
    ]


def _turn_from_z(direction: Array) -> Array:
    """Quaternion (w, x, y, z) that turns the z axis onto a unit vector (3,)."""
    w = 1.0 + direction[2]
    if w < 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([w, -direction[1], direction[0], 0.0])
    return np.asarray(quaternion / np.linalg.norm(quaternion))
