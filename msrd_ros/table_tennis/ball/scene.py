"""The physical scene: table, net, ball, air, rubber and paddle, and their form for compiled code.

World frame: origin on the floor under the table's centre, x forward from the robot, y left, z up; SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.core.paddle import BLADE_RADIUS_M, BLADE_THICKNESS_M


@dataclass(frozen=True)
class Table:
    """ITTF table.

    Restitution: Nakashima 2010. With it a ball dropped from 30 cm comes up to 24 through the air, where the
    rules ask for about 23. Recorded flights ask for 0.96 and events of matches for more than 1 (`reproduce
    ball`), which no table of the rules has. Friction: fitted by `reproduce ball --fit` to 1,388 bounces of
    matches, standard error 0.013.
    """

    length_m: float = 2.74
    width_m: float = 1.525
    height_m: float = 0.76
    thickness_m: float = 0.03
    restitution: float = 0.93
    friction: float = 0.238


@dataclass(frozen=True)
class Net:
    """ITTF net across the middle of the table, `overhang_m` beyond either side line; without friction."""

    height_m: float = 0.1525
    overhang_m: float = 0.1525
    thickness_m: float = 0.004
    restitution: float = 0.05


@dataclass(frozen=True)
class Floor:
    """Where lost balls bounce. Only for the looks: the referee has decided by then."""

    restitution: float = 0.70
    friction: float = 0.25


@dataclass(frozen=True)
class Ball:
    """ITTF ball, a thin hollow sphere."""

    mass_kg: float = 0.0027
    radius_m: float = 0.020

    @property
    def inertia_kg_m2(self) -> float:
        """Moment of inertia of a thin shell, 2/3 m r^2."""
        return 2.0 / 3.0 * self.mass_kg * self.radius_m**2


@dataclass(frozen=True)
class Air:
    """Drag and lift on the ball; density at 20 C.

    Both forces are rho A v^2 / 2 times a coefficient: the drag's is constant, the lift's is
    `lift_slope` S / (1 + `lift_saturation` S) with the spin ratio S = r |spin| / |v|. Without saturation the
    lift is the Magnus force k spin x v, k = rho A r `lift_slope` / (2 m).

    Fitted by `reproduce ball --fit` to 1,388 flights of matches; standard errors 0.005 of the drag, 0.5 of
    the slope and 2.0 of the saturation, which go together.
    """

    density_kg_m3: float = 1.204
    drag_coefficient: float = 0.547
    lift_slope: float = 3.07
    lift_saturation: float = 9.66


@dataclass(frozen=True)
class Rubber:
    """Rebound off inverted rubber, measured on 8,184 bounces (tt_rackets).

    The restitution falls with the speed of approach, e = `restitution` - `restitution_loss_s_m` |v_n|, and
    the tangential impulse is -`tangential_stiffness_kg` times the slip, which reverses the slip.
    """

    restitution: float = 0.917
    restitution_loss_s_m: float = 0.0217
    tangential_stiffness_kg: float = 1.84e-3


@dataclass(frozen=True)
class Blade:
    """The paddle's blade: a flat disk with rubber on both faces; its rim rebounds like the rubber."""

    radius_m: float = BLADE_RADIUS_M
    thickness_m: float = BLADE_THICKNESS_M


class SceneConstants(Protocol):
    """The numbers that the compiled functions read, by name; SI."""

    gravity: float
    drag: float
    """rho Cd A / (2 m), 1/m."""
    magnus: float
    """rho A r / (2 m) times the slope of the lift coefficient."""
    lift_saturation: float
    ball_radius: float
    ball_mass: float
    ball_inertia: float
    table_half_length: float
    table_half_width: float
    table_top: float
    table_underside: float
    table_restitution: float
    table_friction: float
    net_top: float
    net_half_width: float
    net_half_thickness: float
    net_restitution: float
    floor_restitution: float
    floor_friction: float
    rubber_restitution: float
    rubber_restitution_loss: float
    rubber_tangential: float
    blade_radius: float
    blade_half_thickness: float


SCENE_CONSTANTS = np.dtype([(name, np.float64) for name in SceneConstants.__annotations__])
"""`SceneConstants` as a record of NumPy: compiled functions take an array of one of them."""


@dataclass(frozen=True)
class Scene:
    """Everything that the ball can meet. `constants` packs it for the compiled functions."""

    table: Table = field(default_factory=Table)
    net: Net = field(default_factory=Net)
    floor: Floor = field(default_factory=Floor)
    ball: Ball = field(default_factory=Ball)
    air: Air = field(default_factory=Air)
    rubber: Rubber = field(default_factory=Rubber)
    blade: Blade = field(default_factory=Blade)
    gravity_m_s2: float = 9.81

    def constants(self) -> NDArray[np.void]:
        """The scene as one record of `SCENE_CONSTANTS`, shape (1,), for the compiled functions.

        Raises
        ------
        UserError
            If a number is negative or not finite; the message names it.
        """
        ball, air = self.ball, self.air
        force = air.density_kg_m3 * math.pi * ball.radius_m**2 / (2.0 * ball.mass_kg)
        values = {
            "gravity": self.gravity_m_s2,
            "drag": force * air.drag_coefficient,
            "magnus": force * air.lift_slope * ball.radius_m,
            "lift_saturation": air.lift_saturation,
            "ball_radius": ball.radius_m,
            "ball_mass": ball.mass_kg,
            "ball_inertia": ball.inertia_kg_m2,
            "table_half_length": self.table.length_m / 2.0,
            "table_half_width": self.table.width_m / 2.0,
            "table_top": self.table.height_m,
            "table_underside": self.table.height_m - self.table.thickness_m,
            "table_restitution": self.table.restitution,
            "table_friction": self.table.friction,
            "net_top": self.table.height_m + self.net.height_m,
            "net_half_width": self.table.width_m / 2.0 + self.net.overhang_m,
            "net_half_thickness": self.net.thickness_m / 2.0,
            "net_restitution": self.net.restitution,
            "floor_restitution": self.floor.restitution,
            "floor_friction": self.floor.friction,
            "rubber_restitution": self.rubber.restitution,
            "rubber_restitution_loss": self.rubber.restitution_loss_s_m,
            "rubber_tangential": self.rubber.tangential_stiffness_kg,
            "blade_radius": self.blade.radius_m,
            "blade_half_thickness": self.blade.thickness_m / 2.0,
        }
        for name, value in values.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise UserError(f"scene: {name} is {value}; give a finite number that is not negative")
        constants = np.zeros(1, dtype=SCENE_CONSTANTS)
        for name in values:
            constants[name] = values[name]
        constants.setflags(write=False)
        return constants
