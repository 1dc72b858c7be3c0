"""Backlash: what lies between the motors, where the encoders sit, and the links that carry the paddle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]

_FLANK_SHARE = 0.04
"""Share of a joint's largest torque that presses a flank home: where makers of gears measure lost motion."""
_CROSSING_S = 0.01
"""Time constant with which a motor runs through the play."""


class Gears:
    """Play between each motor and its link.

    A motor stands before its link by half of the play towards where it pushes. Below the torque that presses
    the flank home it is in between, so that a joint that carries next to nothing does not rattle.

    Parameters
    ----------
    robot
        Of N joints.
    backlash_rad
        From one flank to the other, at the joint.

    Attributes
    ----------
    position, velocity
        What the encoders read, shape (N,), rad and rad/s.
    """

    def __init__(self, robot: Robot, backlash_rad: float) -> None:
        self._half_rad = 0.5 * backlash_rad
        self._flank_nm = _FLANK_SHARE * robot.limits.torque_nm
        self._ahead: Array = np.zeros(robot.joint_count)
        self.position: Array = np.zeros(robot.joint_count)
        self.velocity: Array = np.zeros(robot.joint_count)

    def rest(self, motors: Array, torque: Array) -> Array:
        """Let the motors stand still at `motors` (N,) in rad under torques (N,) in Nm; gives the links."""
        self._ahead = self._pressed(torque)
        self.position[:] = motors
        self.velocity[:] = 0.0
        return motors - self._ahead

    def turn(self, links: Array, link_velocity: Array, torque: Array, step_s: float) -> None:
        """Run through the play for one step, at whose end the links (N,) are where they are."""
        change = (self._pressed(torque) - self._ahead) * min(step_s / _CROSSING_S, 1.0)
        self._ahead = self._ahead + change
        self.position[:] = links + self._ahead
        self.velocity[:] = link_velocity + change / step_s

    def _pressed(self, torque: Array) -> Array:
        return self._half_rad * np.clip(torque / self._flank_nm, -1.0, 1.0)
