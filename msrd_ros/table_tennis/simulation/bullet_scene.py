"""Floor, table, net, feeder and ball as bodies in a Bullet client.

The arm collides with floor, table and net. The ball meets none of them here: it flies by `step_ball`, and
its body only shows where it is.
"""

from __future__ import annotations

import math
import os
import sys

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.robot import STEP_S

Colour = tuple[float, float, float, float]

TABLE_BLUE: Colour = (0.07, 0.33, 0.62, 1.0)
LINE_WHITE: Colour = (0.94, 0.95, 0.96, 1.0)
NET_GREY: Colour = (0.16, 0.19, 0.22, 1.0)
LEG_GREY: Colour = (0.36, 0.37, 0.39, 1.0)
FLOOR_GREY: Colour = (0.66, 0.71, 0.75, 1.0)
BALL_ORANGE: Colour = (1.0, 0.62, 0.10, 1.0)
FEEDER_GREEN: Colour = (0.16, 0.36, 0.30, 1.0)

LINE_WIDTH_M = 0.02
TAPE_WIDTH_M = 0.015
_FLOOR_SIZE_M = (400.0, 400.0, 0.2)
_PAINT_M = 0.0015
"""How far painted lines stand out, so that they are not drawn within the table."""


def connect_bullet(gui: bool, gravity_m_s2: float) -> int:
    """Start Bullet with our time step, with or without its window, and return the client's number.

    Raises
    ------
    UserError
        If a window is wanted and there is no display.
    """
    # Bullet ends the whole process if it finds no X server.
    if gui and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise UserError("Bullet's window needs a display (DISPLAY is not set); run with gui:=false")
    client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
    if client < 0:
        raise UserError("Bullet's window did not open; run with gui:=false where there is no display")
    pybullet.setGravity(0.0, 0.0, -gravity_m_s2, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=STEP_S, deterministicOverlappingPairs=1, physicsClientId=client
    )
    return client


class BulletScene:
    """The things around the robot.

    Parameters
    ----------
    client
        Of PyBullet.
    scene
        Sizes.
    visible
        Whether to add what only meets the eye; it costs time to set up.
    feeder
        Whether a feeder is among it; it stands where an arm at the far end would play.
    """

    def __init__(self, client: int, scene: Scene, *, visible: bool, feeder: bool = True) -> None:
        self._client = client
        self._visible = visible
        table, net = scene.table, scene.net
        half = (table.length_m / 2, table.width_m / 2, table.thickness_m / 2)
        self._box(
            (_FLOOR_SIZE_M[0] / 2, _FLOOR_SIZE_M[1] / 2, _FLOOR_SIZE_M[2] / 2),
            (0.0, 0.0, -_FLOOR_SIZE_M[2] / 2),
            FLOOR_GREY,
            solid=True,
        )
        self._box(half, (0.0, 0.0, table.height_m - half[2]), TABLE_BLUE, solid=True)
        net_half = (net.thickness_m / 2, table.width_m / 2 + net.overhang_m, net.height_m / 2)
        self._box(net_half, (0.0, 0.0, table.height_m + net_half[2]), NET_GREY, solid=True)
        self.ball = -1
        if visible:
            self._paint_table(scene)
            self._stand_table(scene)
            if feeder:
                self._set_feeder()
            self.ball = self.add_ball(scene.ball.radius_m, BALL_ORANGE)

    def add_ball(
        self, radius_m: float, colour: Colour, position: tuple[float, ...] = (0.0, 0.0, -1.0)
    ) -> int:
        """A ball to look at, which touches nothing; returns its body."""
        shape = pybullet.createVisualShape(
            pybullet.GEOM_SPHERE, radius=radius_m, rgbaColor=colour, physicsClientId=self._client
        )
        body: int = pybullet.createMultiBody(
            0.0, -1, shape, basePosition=position, physicsClientId=self._client
        )
        return body

    def show_ball(self, position: NDArray[np.float64]) -> None:
        """Move the ball's body to `position` (3,), m."""
        if self.ball >= 0:
            pybullet.resetBasePositionAndOrientation(
                self.ball, position[:3].tolist(), (0.0, 0.0, 0.0, 1.0), physicsClientId=self._client
            )

    def _box(
        self,
        half: tuple[float, float, float],
        centre: tuple[float, float, float],
        colour: Colour,
        *,
        solid: bool = False,
        turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        collision = visual = -1
        if solid:
            collision = pybullet.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client
            )
        if self._visible:
            visual = pybullet.createVisualShape(
                pybullet.GEOM_BOX, halfExtents=half, rgbaColor=colour, physicsClientId=self._client
            )
        orientation = pybullet.getQuaternionFromEuler(turn)
        pybullet.createMultiBody(0.0, collision, visual, centre, orientation, physicsClientId=self._client)

    def _tube(
        self, radius: float, length: float, centre: tuple[float, float, float], colour: Colour, pitch: float
    ) -> None:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_CYLINDER,
            radius=radius,
            length=length,
            rgbaColor=colour,
            physicsClientId=self._client,
        )
        orientation = pybullet.getQuaternionFromEuler((0.0, pitch, 0.0))
        pybullet.createMultiBody(0.0, -1, shape, centre, orientation, physicsClientId=self._client)

    def _paint_table(self, scene: Scene) -> None:
        table, net = scene.table, scene.net
        length, width, top = table.length_m / 2, table.width_m / 2, table.height_m
        line = LINE_WIDTH_M / 2
        for side in (-1.0, 1.0):
            self._box((length, line, _PAINT_M), (0.0, side * (width - line), top), LINE_WHITE)
            self._box((line, width, _PAINT_M), (side * (length - line), 0.0, top), LINE_WHITE)
            post = (0.0, side * (width + net.overhang_m), top + net.height_m / 2 - 0.02)
            self._box((0.01, 0.01, net.height_m / 2 + 0.02), post, LEG_GREY)
        self._box((length, 0.004, _PAINT_M), (0.0, 0.0, top), LINE_WHITE)
        tape = TAPE_WIDTH_M / 2
        self._box(
            (net.thickness_m / 2 + _PAINT_M, width + net.overhang_m, tape),
            (0.0, 0.0, top + net.height_m - tape),
            LINE_WHITE,
        )

    def _stand_table(self, scene: Scene) -> None:
        table = scene.table
        height = (table.height_m - table.thickness_m) / 2
        for x in (-0.95, 0.95):
            for y in (-0.55, 0.55):
                self._box((0.025, 0.025, height), (x, y, height), LEG_GREY)
            self._box((0.02, 0.55, 0.025), (x, 0.0, 2 * height - 0.1), LEG_GREY)

    def _set_feeder(self) -> None:
        # The muzzle is where balls leave; the tube slopes as they do.
        slope = math.radians(25.0)
        x, z = 1.5, 1.06
        back = 0.22
        centre = (x + back * math.cos(slope), 0.0, z - back * math.sin(slope))
        self._tube(0.045, 2 * back - 0.03, centre, FEEDER_GREEN, -(math.pi / 2 - slope))
        foot = (centre[0] + 0.10, 0.0, (centre[2] - 0.08) / 2)
        self._box((0.03, 0.03, foot[2]), foot, LEG_GREY)
        self._box((0.16, 0.16, 0.015), (foot[0], 0.0, 0.015), LEG_GREY)
        self._box((0.11, 0.10, 0.09), (foot[0] + 0.02, 0.0, centre[2] - 0.07), FEEDER_GREEN)
