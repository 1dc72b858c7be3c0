"""Where a teacher's hand leads the paddle, in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.core.errors import UserError
from msrd_ros.robots.rotations import turn_between, turned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HandGesture:
    """Where the hand leads the paddle: a whole gesture in time, or one streamed point.

    A gesture is followed from its first point to its last, which the hand then keeps. From one point the
    hand goes on with the point's velocities until the next, or until it has not been heard of for
    `GuidanceConfig.hand_timeout_s`.

    Attributes
    ----------
    times_s
        From when the target is given, increasing, shape (N,).
    positions
        Of the blade's centre, shape (N, 3), m.
    quaternions
        x, y, z, w of the last link, shape (N, 4).
    velocities, angular_velocities
        Shape (N, 3), m/s and rad/s.
    """

    times_s: Array
    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array

    def __post_init__(self) -> None:
        count = len(self.times_s)
        shapes = {"positions": 3, "quaternions": 4, "velocities": 3, "angular_velocities": 3}
        if count < 1 or np.any(np.diff(self.times_s) <= 0.0) or not np.isfinite(self.times_s).all():
            raise UserError("hand gesture: its times must be finite and increase from point to point")
        for name, width in shapes.items():
            values = getattr(self, name)
            if values.shape != (count, width):
                raise UserError(f"hand gesture: {name} has shape {values.shape}; give ({count}, {width})")
            if not np.isfinite(values).all():
                raise UserError(f"hand gesture: {name} holds a number that is not finite")
        if np.any(np.linalg.norm(self.quaternions, axis=1) < 1e-6):
            raise UserError("hand gesture: quaternions holds a zero; give unit quaternions x, y, z, w")

    @classmethod
    def now(
        cls,
        position: ArrayLike,
        quaternion: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> HandGesture:
        """One streamed point: pose and velocities, shapes (3,), (4,), (3,) and (3,), that hold now."""
        parts = (position, quaternion, velocity, angular_velocity)
        return cls(np.zeros(1), *(np.array([part], dtype=np.float64) for part in parts))


@njit(cache=True, nogil=True)
def gesture_at(
    times: Array, positions: Array, rotations: Array, twists: Array, time: float
) -> tuple[Array, Array, Array]:
    """Pose and twist of a gesture at one time: cubic in position, blended in rotation."""
    last = len(times) - 1
    if time <= times[0]:
        return positions[0], rotations[0], np.zeros(6)
    if time >= times[last]:
        return positions[last], rotations[last], np.zeros(6)
    index = np.searchsorted(times, time, side="right") - 1
    span = times[index + 1] - times[index]
    s = (time - times[index]) / span
    position, twist = np.empty(3), np.empty(6)
    for axis in range(3):
        p0, p1 = positions[index, axis], positions[index + 1, axis]
        m0, m1 = twists[index, axis] * span, twists[index + 1, axis] * span
        b = 3.0 * (p1 - p0) - 2.0 * m0 - m1
        c = m0 + m1 - 2.0 * (p1 - p0)
        position[axis] = p0 + s * (m0 + s * (b + s * c))
        twist[axis] = (m0 + s * (2.0 * b + s * 3.0 * c)) / span
        twist[3 + axis] = (1.0 - s) * twists[index, 3 + axis] + s * twists[index + 1, 3 + axis]
    rotation = turned(rotations[index], s * turn_between(rotations[index], rotations[index + 1]))
    return position, rotation, twist
