"""Where a stroke can be told to land its ball, and the nearest place in reach to one that is not."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.scene import Table

Array = NDArray[np.float64]

TARGET_NAMES = ("target_x_m", "target_y_m")
"""Columns that an observation has behind the others where a policy takes a target: where its ball is to land,
in the frame `world`."""


@dataclass(frozen=True)
class Reach:
    """A grid of targets on the far half of the table; each stands for the rectangle around it.

    Attributes
    ----------
    x_m, y_m
        Evenly spaced coordinates of the grid, (X,) and (Y,), in `world`, rising.
    hits
        Whether the stroke lands its balls there when it is told to, (X, Y).
    """

    x_m: Array
    y_m: Array
    hits: NDArray[np.bool_]

    @classmethod
    def grid(cls, x_m: ArrayLike, y_m: ArrayLike) -> Reach:
        """Targets that have yet to be tried."""
        x, y = np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64)
        return cls(x, y, np.zeros((len(x), len(y)), dtype=np.bool_))

    @property
    def points(self) -> Array:
        """All targets of the grid, (X Y, 2), x by x."""
        return np.stack(np.meshgrid(self.x_m, self.y_m, indexing="ij"), axis=-1).reshape(-1, 2)

    @property
    def targets(self) -> Array:
        """Those that are hit, (n, 2)."""
        targets: Array = self.points[self.hits.reshape(-1)]
        return targets

    def draw(self, rng: np.random.Generator) -> Array:
        """A point in reach, (2,), evenly drawn."""
        target: Array = rng.choice(self.targets) + self._half_m * rng.uniform(-1.0, 1.0, 2)
        return target

    def nearest(self, point: ArrayLike) -> Array | None:
        """The point in reach that is nearest to `point` (2,), in m: itself if it is in reach.

        None where nothing is in reach.
        """
        wanted, half = np.asarray(point, dtype=np.float64), self._half_m
        if not self.hits.any():
            return None
        places = np.clip(wanted, self.targets - half, self.targets + half)
        nearest: Array = places[np.hypot(*(places - wanted).T).argmin()]
        return nearest

    def holds(self, point: ArrayLike) -> bool:
        """Whether a point (2,), m, is in reach."""
        nearest = self.nearest(point)
        return nearest is not None and np.allclose(nearest, np.asarray(point, dtype=np.float64), atol=1e-9)

    def require(self, point: ArrayLike, whose: str) -> None:
        """Refuse a target that is not in reach.

        Raises
        ------
        UserError
            If it is not; names the nearest that is.
        """
        nearest = self.nearest(point)
        if nearest is None:
            raise UserError(f"target {say_point(point)}: {whose} hits no target reliably; leave it out")
        if not self.holds(point):
            raise UserError(
                f"target {say_point(point)} is out of reach of {whose}; the nearest that is in reach is "
                f"{say_point(nearest)}"
            )

    @property
    def _half_m(self) -> Array:
        return np.array([self.x_m[1] - self.x_m[0], self.y_m[1] - self.y_m[0]]) / 2.0

    def to_json(self) -> dict[str, Any]:
        """Plain data: a text of 0 and 1 for each x."""
        rows = ["".join("1" if hit else "0" for hit in row) for row in self.hits]
        return {"x_m": self.x_m.tolist(), "y_m": self.y_m.tolist(), "hits": rows}

    @classmethod
    def from_json(cls, data: object, where: str) -> Reach:
        """Inverse of `to_json`.

        Raises
        ------
        UserError
            If it is no grid; begins with `where`.
        """
        try:
            if not isinstance(data, Mapping):
                raise TypeError
            x_m, y_m = (np.array(data[name], dtype=np.float64) for name in ("x_m", "y_m"))
            hits = np.array([[{"0": False, "1": True}[mark] for mark in row] for row in data["hits"]])
            rises = all(line.ndim == 1 and len(line) > 1 and np.all(np.diff(line) > 0) for line in (x_m, y_m))
            if not rises or hits.shape != (len(x_m), len(y_m)):
                raise ValueError
        except (KeyError, TypeError, ValueError, OverflowError):
            raise UserError(f"{where}: the reach is no grid of targets; learn the targets again") from None
        return cls(x_m, y_m, hits.astype(np.bool_))


def require_on_table(point: ArrayLike, where: str) -> None:
    """Refuse a target that no ball can be returned to.

    Raises
    ------
    UserError
        If it is not on the far half; names the nearest point that is.
    """
    table, wanted = Table(), np.asarray(point, dtype=np.float64)
    if not np.isfinite(wanted).all():
        raise UserError(f"{where}: the point is not finite; give x and y in m")
    low, high = np.array([0.0, -table.width_m / 2]), np.array([table.length_m / 2, table.width_m / 2])
    on_table = np.clip(wanted, low, high)
    if not np.array_equal(on_table, wanted):
        raise UserError(
            f"{where}: {say_point(wanted)} is not on the far half of the table; the nearest point that is on "
            f"it is {say_point(on_table)}"
        )


_POINT = re.compile(r"x (-?[0-9.]+), y (-?[0-9.]+) m")


def read_point(text: str) -> Array | None:
    """Inverse of `say_point`, to the millimetre; None of another text."""
    found = _POINT.fullmatch(text)
    return None if found is None else np.array([float(found[1]), float(found[2])])


def say_point(point: ArrayLike) -> str:
    """A point (2,) in m as text."""
    x, y = np.asarray(point, dtype=np.float64)
    return f"x {x:.3f}, y {y:.3f} m"
