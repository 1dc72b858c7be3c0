"""Sketches to begin with, found once for all tests of a run."""

from __future__ import annotations

from functools import cache

from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.default_sketch import default_sketch
from msrd_ros.table_tennis.teachers.sketch import Sketch

ARMS = ("sawyer", "ur10e")
SPINS_RAD_S = {"push-like": 0.0, "topspin-like": 80.0, "slice-like": -80.0}
"""Right after the hit, by the paddle's motion."""


@cache
def drawn(arm: str, side: Side, motion: str = "push-like") -> Sketch:
    """The default sketch of an arm for the nominal feed."""
    return default_sketch(load_robot(arm), side, strategy=f"my-{motion}", spin_y_rad_s=SPINS_RAD_S[motion])
