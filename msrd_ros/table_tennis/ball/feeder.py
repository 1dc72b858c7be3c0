"""The feeder: throws balls at one side of the robot, each a little different."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.flight import POSITION, SPIN, VELOCITY, ball_state
from msrd_ros.table_tennis.strategies.table import Side

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Feed:
    """One launch: position in m, velocity in m/s and spin in rad/s of the ball, world frame."""

    position: Vector
    velocity: Vector
    spin: Vector

    def state(self) -> NDArray[np.float64]:
        """The ball at the launch, shape (9,)."""
        return ball_state(self.position, self.velocity, self.spin)

    def launched(self) -> NDArray[np.float64]:
        """`state`, of a ball that is to fly.

        Raises
        ------
        UserError
            If a number is not finite.
        """
        state = self.state()
        if not np.isfinite(state).all():
            raise UserError("feed holds a number that is not finite; give position, velocity and spin in SI")
        return state

    @classmethod
    def from_state(cls, state: NDArray[np.float64]) -> Feed:
        """Read a launch from a ball of shape (9,)."""
        return cls(_vector(state[POSITION]), _vector(state[VELOCITY]), _vector(state[SPIN]))


@dataclass(frozen=True)
class FeedSpread:
    """How far feeds stray from the nominal one: half widths of independent uniform distributions.

    Parameters
    ----------
    speed
        As a fraction of the nominal speed.
    elevation_rad, yaw_rad
        Of the direction of launch.
    spin_rad_s
        Of the backspin.
    sideways_m
        Of the position, along y.
    """

    speed: float
    elevation_rad: float
    yaw_rad: float
    spin_rad_s: float
    sideways_m: float

    def wider(self, factor: float) -> FeedSpread:
        """The same, `factor` times as wide in everything."""
        return FeedSpread(*(factor * width for width in astuple(self)))


NO_SPREAD = FeedSpread(0.0, 0.0, 0.0, 0.0, 0.0)
EASY = FeedSpread(0.015, math.radians(0.75), math.radians(0.75), 10.0, 0.01)
STANDARD = FeedSpread(0.03, math.radians(1.5), math.radians(1.5), 20.0, 0.02)
"""Twice `EASY`: the level that learning is judged on."""
WIDE = STANDARD.wider(1.5)

SPREADS: dict[str, FeedSpread] = {"none": NO_SPREAD, "easy": EASY, "standard": STANDARD, "wide": WIDE}
"""By the name under which parameters know them."""


EVALUATION_STREAM = 0x5EED
"""Mixed into the seed of evaluations, so that none of their balls is one that training draws."""


@dataclass(frozen=True)
class Feeder:
    """Stands beyond the far half and throws towards -x, over the net onto the robot's half.

    Parameters
    ----------
    position_m
        Where the ball leaves.
    speed_m_s
        At the launch.
    elevation_rad
        Of the launch, above the horizontal.
    yaw_rad
        Of the launch, off the table's axis: towards -y for a forehand, +y for a backhand.
    backspin_rad_s
        About the horizontal axis across the flight.
    """

    position_m: Vector = (1.5, 0.0, 1.06)
    speed_m_s: float = 5.45
    elevation_rad: float = math.radians(25.0)
    yaw_rad: float = math.radians(6.5)
    backspin_rad_s: float = 60.0

    def nominal(self, side: Side) -> Feed:
        """The feed to one side, without spread."""
        return Feed.from_state(self._launch(side, np.zeros((1, _SPREAD_SIZE)), NO_SPREAD)[0])

    def sample(self, side: Side, spread: FeedSpread, rng: np.random.Generator) -> Feed:
        """One feed to one side, drawn from `spread`."""
        return Feed.from_state(self.sample_states(side, spread, 1, rng)[0])

    def sample_states(
        self, side: Side, spread: FeedSpread, count: int, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """`count` launches as balls, shape (count, 9); the same draws as as many calls of `sample`."""
        return self._launch(side, rng.uniform(-1.0, 1.0, size=(count, _SPREAD_SIZE)), spread)

    def _launch(self, side: Side, draws: NDArray[np.float64], spread: FeedSpread) -> NDArray[np.float64]:
        speed = self.speed_m_s * (1.0 + spread.speed * draws[:, 0])
        elevation = self.elevation_rad + spread.elevation_rad * draws[:, 1]
        yaw = self.yaw_rad + spread.yaw_rad * draws[:, 2]
        backspin = self.backspin_rad_s + spread.spin_rad_s * draws[:, 3]
        sign = side.sign
        forward_x, forward_y = -np.cos(yaw), sign * np.sin(yaw)
        states = np.zeros((len(draws), 9))
        states[:, POSITION] = self.position_m
        states[:, 1] += spread.sideways_m * draws[:, 4]
        states[:, 3] = speed * np.cos(elevation) * forward_x
        states[:, 4] = speed * np.cos(elevation) * forward_y
        states[:, 5] = speed * np.sin(elevation)
        # Topspin turns about z x forward; backspin the other way round.
        states[:, 6] = backspin * forward_y
        states[:, 7] = -backspin * forward_x
        return states


_SPREAD_SIZE = 5


def _vector(values: NDArray[np.float64]) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])
