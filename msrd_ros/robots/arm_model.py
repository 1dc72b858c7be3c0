"""The arm as one record of numbers: what the compiled functions take.

As for the scene, an array of one record is handed in, and the number of joints is part of its type, so that
the compiler knows it: loops over joints come out as for an arm that is written into the code.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Arm = NDArray[np.void]
"""An array of one record with the fields of `ArmModel`, shape (1,)."""


class ArmModel(Protocol):
    """The fields of the record, by name, for N joints and B spheres; SI.

    Every joint turns about z of its child link. Frames are those of the links behind the joints.
    """

    base_position: Array
    """(3,), and rotation (3, 3), of the root link in `world`."""
    base_rotation: Array
    offsets: Array
    """(N, 3), and rotations (N, 3, 3), of each joint on the link before it."""
    rotations: Array
    paddle_position: Array
    """(3,), and rotation (3, 3), of the paddle on the last link."""
    paddle_rotation: Array
    masses: Array
    """(N,); centres (N, 3) and inertias (N, 3, 3) about them, the paddle and all that is fixed included."""
    centres: Array
    inertias: Array
    friction: Array
    """(N,), viscous, Nm per rad/s."""
    lower: Array
    """(N,), rad: where a joint stops; between `lowest` and `highest` every command stays."""
    upper: Array
    lowest: Array
    highest: Array
    speed: Array
    """(N,), rad/s."""
    acceleration: Array
    """(N,), rad/s^2."""
    torque: Array
    """(N,), Nm."""
    sphere_links: NDArray[np.int64]
    """(B,): the link that each sphere is on, counted from 0; -1 is the root link."""
    sphere_centres: Array
    """(B, 3)."""
    sphere_radii: Array
    """(B,)."""
    stand: Array
    """(M, 4): what stands still under the arm, as spheres x, y, z, radius in `world`."""
    apart: NDArray[np.int64]
    """(P, 2): spheres of the arm that must not meet."""


def pack(values: Mapping[str, NDArray[Any]]) -> Arm:
    """The fields of `ArmModel` as an array of one record, shape (1,), that nobody can write to."""
    kinds = [(name, values[name].dtype, values[name].shape) for name in ArmModel.__annotations__]
    record = np.zeros(1, dtype=np.dtype(kinds))
    for name in ArmModel.__annotations__:
        record[name][0] = values[name]
    record.setflags(write=False)
    return record


def slowed(model: Arm, share: float) -> Arm:
    """The same arm with that share of its limits of speed and acceleration."""
    if share == 1.0:
        return model
    slower = model.copy()
    for name in ("speed", "acceleration"):
        slower[name] *= share
    slower.setflags(write=False)
    return slower
