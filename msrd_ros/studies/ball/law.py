"""The numbers of a law of flight and rebound, and how recorded states are read by it."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.table_tennis.ball.scene import Air, Scene, Table


@dataclass(frozen=True)
class BallLaw:
    """What is fitted.

    Attributes
    ----------
    drag_coefficient, lift_slope, lift_saturation
        Of the flight, see `scene.Air`.
    restitution, friction
        Of the table.
    velocity_lag_s
        A recorded state has the position at its time and the velocity of so long after it.
    gravity_m_s2
        Left free only to see whether the recordings have the right one.
    """

    drag_coefficient: float
    lift_slope: float
    lift_saturation: float
    restitution: float
    friction: float
    velocity_lag_s: float
    gravity_m_s2: float = Scene().gravity_m_s2

    @classmethod
    def of(cls, scene: Scene, velocity_lag_s: float) -> BallLaw:
        """The law by which balls fly in a scene."""
        air, table = scene.air, scene.table
        return cls(
            air.drag_coefficient,
            air.lift_slope,
            air.lift_saturation,
            table.restitution,
            table.friction,
            velocity_lag_s,
            scene.gravity_m_s2,
        )

    def constants(self) -> NDArray[np.void]:
        """The law as a scene for the compiled functions, shape (1,)."""
        return Scene(
            table=Table(restitution=self.restitution, friction=self.friction),
            air=Air(
                drag_coefficient=self.drag_coefficient,
                lift_slope=self.lift_slope,
                lift_saturation=self.lift_saturation,
            ),
            gravity_m_s2=self.gravity_m_s2,
        ).constants()

    def numbers(self) -> dict[str, float]:
        """By name, for files."""
        return asdict(self)


OLD_LAW = BallLaw(0.50, 0.357, 0.0, 0.90, 0.25, 0.0)
"""Of version 0.1.0, from papers; it took recorded states as they are."""

LAW = BallLaw.of(Scene(), velocity_lag_s=0.0182)
"""Of the simulators; the lag is that of the events of Ace's matches."""
