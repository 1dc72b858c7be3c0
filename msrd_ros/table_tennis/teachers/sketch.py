"""A stroke as a person sketches it: three poses of the paddle, and when it is there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.rotations import quaternion_from_rotation, rotation_from_quaternion
from msrd_ros.table_tennis.ball.feeder import Feed, Vector
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import path_at
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, PATH_ROWS, feed_path

Array = NDArray[np.float64]

Quaternion = tuple[float, float, float, float]

LATEST_CONTACT_S = (PATH_ROWS - 1) * PATH_PERIOD_S
"""So far a fed ball is foreseen."""
SHORTEST_S, LONGEST_S = 0.05, 1.2
"""Of a swing and of a follow-through."""


class Moment(StrEnum):
    """When a sketch says where the paddle is."""

    WIND_UP = "wind-up"
    CONTACT = "contact"
    FOLLOW_THROUGH = "follow-through"


@dataclass(frozen=True)
class Ghost:
    """Where the paddle shall be at one moment, in `world`.

    Parameters
    ----------
    position_m
        Of the blade's centre.
    quaternion
        x, y, z, w of the paddle: y is the normal of its front face, z points along the handle to the blade.
        Of any length but zero.

    Raises
    ------
    UserError
        If a number is not finite, or the quaternion is zero.
    """

    position_m: Vector
    quaternion: Quaternion

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position_m, *self.quaternion]).all():
            raise UserError(f"sketch: {self} holds a number that is not finite; give metres and a quaternion")
        if np.linalg.norm(self.quaternion) < 1e-6:
            raise UserError("sketch: a ghost's quaternion is zero; give x, y, z, w, such as 0, 0, 0, 1")

    @classmethod
    def of(cls, position: Array, rotation: Array) -> Ghost:
        """From a position (3,) in m and a rotation matrix (3, 3)."""
        x, y, z, w = map(float, quaternion_from_rotation(rotation))
        return cls(_vector(position), (x, y, z, w))

    @property
    def position(self) -> Array:
        """Of the blade's centre, shape (3,), m."""
        return np.array(self.position_m)

    @property
    def rotation(self) -> Array:
        """Axes of the paddle in `world` as columns, shape (3, 3)."""
        rotation: Array = rotation_from_quaternion(np.array(self.quaternion))
        return rotation

    def moved(self, way: Array) -> Ghost:
        """The same, displaced by `way` (3,) in m."""
        return replace(self, position_m=_vector(self.position + way))


@dataclass(frozen=True)
class Sketch:
    """A stroke that a person wants.

    Parameters
    ----------
    strategy
        Any well-formed name.
    side
        Where the balls go.
    feed
        The ball that the sketch is for.
    wind_up, contact, follow_through
        Where the paddle turns round, where its face meets the ball, and where it comes to rest.
    contact_s
        When it meets the ball, since the launch.
    swing_s, follow_s
        From the wind-up to the contact and from there to the follow-through. If None, as short as is
        comfortable for the arm (`plan_sketch`).
    ready_rad
        Joint angles that the arm waits in, one for each joint; it waits in the wind-up if None.

    Raises
    ------
    UserError
        If a time is no time, or the name is none.
    """

    strategy: StrategyLabel
    side: Side
    feed: Feed
    wind_up: Ghost
    contact: Ghost
    follow_through: Ghost
    contact_s: float
    swing_s: float | None = None
    follow_s: float | None = None
    ready_rad: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        StrategyLabel.parse(self.strategy, "sketch: strategy")
        if not SHORTEST_S <= self.contact_s <= LATEST_CONTACT_S:
            raise UserError(
                f"{self._name}: contact_s is {self.contact_s}; say when the ball is met, "
                f"{SHORTEST_S:g} to {LATEST_CONTACT_S:g} s after its launch"
            )
        for name in ("swing_s", "follow_s"):
            value = getattr(self, name)
            if value is not None and not SHORTEST_S <= value <= LONGEST_S:
                raise UserError(f"{self._name}: {name} is {value}; give {SHORTEST_S:g} to {LONGEST_S:g} s")
        if (self.swing_s or 0.0) > self.contact_s:
            raise UserError(
                f"{self._name}: swing_s is {self.swing_s}, and the ball is met {self.contact_s} s after its "
                "launch; a swing begins after the launch: make it shorter"
            )

    @property
    def _name(self) -> str:
        return f"sketch {self.strategy}"

    @property
    def ghosts(self) -> dict[Moment, Ghost]:
        """The three poses in the order in which the paddle gets there."""
        return {
            Moment.WIND_UP: self.wind_up,
            Moment.CONTACT: self.contact,
            Moment.FOLLOW_THROUGH: self.follow_through,
        }

    def with_ghosts(self, ghosts: Mapping[Moment, Ghost]) -> Sketch:
        """The same with some ghosts elsewhere."""
        wind_up, contact, follow_through = ({**self.ghosts, **ghosts}[moment] for moment in Moment)
        return replace(self, wind_up=wind_up, contact=contact, follow_through=follow_through)


def variation(
    sketch: Sketch,
    rng: np.random.Generator,
    timing_s: float = 0.01,
    tempo: float = 0.05,
    scene: Scene | None = None,
) -> Sketch:
    """The same stroke as its person would do it another time, a little earlier or later.

    All three ghosts are shifted along the ball's path by as far as the ball flies meanwhile, so that the same
    motion meets the ball at another moment. Times that are given become a little longer or shorter. Whether
    the arm can do it, `plan_sketch` tells.

    Parameters
    ----------
    rng
        Draws the differences.
    timing_s
        Standard deviation of the contact's moment; draws are cut off at twice that.
    tempo
        Standard deviation of the durations, as a fraction, cut off likewise.
    scene
        That the ball flies in; the standard one if None.

    Raises
    ------
    UserError
        If a standard deviation is negative or not finite.
    """
    for name, value in (("timing_s", timing_s), ("tempo", tempo)):
        if not (np.isfinite(value) and value >= 0.0):
            raise UserError(f"variation: {name} is {value}; give a finite number that is not negative")
    late, slower, longer = np.clip(rng.standard_normal(3), -2.0, 2.0) * (timing_s, tempo, tempo)
    contact_s = float(np.clip(sketch.contact_s + late, SHORTEST_S, LATEST_CONTACT_S))
    path = feed_path(sketch.feed, (scene or Scene()).constants())
    before, after = (path_at(path, PATH_PERIOD_S, time)[:3] for time in (sketch.contact_s, contact_s))
    way = after - before
    shifted = sketch.with_ghosts({moment: ghost.moved(way) for moment, ghost in sketch.ghosts.items()})
    return replace(
        shifted,
        contact_s=contact_s,
        swing_s=_stretched(sketch.swing_s, slower, contact_s),
        follow_s=_stretched(sketch.follow_s, longer, LONGEST_S),
    )


def _stretched(duration_s: float | None, by: float, most_s: float) -> float | None:
    if duration_s is None:
        return None
    return float(np.clip(duration_s * (1.0 + by), SHORTEST_S, min(most_s, LONGEST_S)))


def _vector(values: Array) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])
