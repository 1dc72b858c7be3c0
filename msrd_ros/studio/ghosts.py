"""A sketched stroke in the scene: three ghosts of the paddle, the ball's path and where it lands."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from msrd_ros.core.paddle import BLADE_RADIUS_M, BLADE_THICKNESS_M
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.studio.private_viser import PrivateViser
from msrd_ros.studio.scene import segments
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.teachers.sketch import Moment
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan

Array = NDArray[np.float64]

BLUE, RED, GREEN, GREY = (46, 111, 190), (200, 30, 30), (22, 140, 84), (120, 130, 145)
_HANDLE_M = (0.025, 0.02, 0.1)
_LANDING_M = 0.06
_THICK_M = {"paddle": 0.01, "coming": 0.008, "going": 0.014}
_POINTS = 80
"""Of each line."""


class Ghosts:
    """Handles of what a sketch shows; nothing is seen before the first.

    Parameters
    ----------
    viser
        Whose scene it is.
    """

    def __init__(self, viser: PrivateViser) -> None:
        self._viser = viser
        scene, shape = viser.server.scene, _paddle()
        self._paddles: dict[Moment, Any] = {}
        self._labels: dict[Moment, Any] = {}
        for moment in Moment:
            name = f"/sketch/{moment.name.lower()}"
            self._paddles[moment] = scene.add_mesh_simple(
                name, shape.vertices, shape.faces, color=BLUE, opacity=0.6, side="double", visible=False
            )
            self._labels[moment] = scene.add_label(
                f"{name}/label", moment.value, position=(0.0, 0.0, 1.3 * BLADE_RADIUS_M), visible=False
            )
        self._lines: dict[str, Any] = {}
        self._landing = scene.add_cylinder(
            "/sketch/landing", _LANDING_M, 0.004, color=GREEN, cast_shadow=False, visible=False
        )

    def hide(self) -> None:
        """Show nothing of it."""
        with self._viser.server.atomic():
            for handle in self._all():
                handle.visible = False

    def show(self, plan: SketchPlan) -> None:
        """Show a sketch: what the arm cannot do in red, the ball after the hit in green if it comes back."""
        bad = {violation.ghost for violation in plan.violations}
        prediction = plan.prediction
        colour = GREEN if prediction.outcome.returned else RED
        hit = int(np.searchsorted(prediction.times_s, prediction.outcome.hit_time_s))
        struck = prediction.outcome.struck
        ball = prediction.path[:, :3]
        with self._viser.server.atomic():
            for moment, ghost in plan.sketch.ghosts.items():
                paddle = self._paddles[moment]
                paddle.position = ghost.position
                paddle.wxyz = np.roll(quaternion_from_rotation(ghost.rotation), 1)
                paddle.color = RED if moment in bad else BLUE
                paddle.visible = self._labels[moment].visible = True
            self._draw("paddle", plan.paddle[:, :3], RED if plan.violations else BLUE)
            self._draw("coming", ball[: hit + 1] if struck else ball, GREY)
            self._draw("going", ball[hit:] if struck else ball[:0], colour)
            self._show_landing(plan, colour)

    def _draw(self, name: str, points: Array, colour: tuple[int, int, int]) -> None:
        if name in self._lines:
            self._lines.pop(name).remove()
        if len(points) < 2:
            return
        self._lines[name] = self._viser.server.scene.add_line_segments(
            f"/sketch/{name}", segments(points, _POINTS), colour, thickness=_THICK_M[name]
        )

    def _show_landing(self, plan: SketchPlan, colour: tuple[int, int, int]) -> None:
        outcome = plan.prediction.outcome
        place = np.array([outcome.landing_x_m, outcome.landing_y_m, Scene().table.height_m])
        self._landing.visible = bool(np.isfinite(place).all())
        if self._landing.visible:
            self._landing.position = place
            self._landing.color = colour

    def _all(self) -> list[Any]:
        return [*self._paddles.values(), *self._labels.values(), *self._lines.values(), self._landing]


def _paddle() -> Any:
    """Blade and handle in the paddle's frame: the blade's centre, y its normal, z away from the handle."""
    upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    blade = trimesh.creation.cylinder(BLADE_RADIUS_M, BLADE_THICKNESS_M, transform=upright)
    handle = trimesh.creation.box(_HANDLE_M)
    handle.apply_translation([0.0, 0.0, -BLADE_RADIUS_M - _HANDLE_M[2] / 2 + 0.01])
    return trimesh.util.concatenate([blade, handle])
