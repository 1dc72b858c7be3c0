"""Ten ways to dock: a task to choose a recipe on, made for nothing else.

A planar rotorcraft comes down on a pad. Episodes have no end: whoever has crashed lies there, whoever has
left the bounds falls on. The truth pays the way to the pad, +100 a step at rest and -100 a step once lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

STEP_S = 0.04
STEPS = 300
OBSERVATIONS = ("x", "z", "vx", "vz", "angle", "omega", "left", "right")
ACTIONS = ("lift", "turn")
HALF_WIDTH = 1.2
RESTING_STEPS = 10
WAYS = (
    ((-0.6, 1.2, 3.0), (-0.1, 0.0)),
    ((0.6, 1.2, 3.0), (0.1, 0.0)),
    ((0.0, 0.4, 5.0), (0.0, 0.0)),
    ((-0.5, 0.3, 5.0), (-0.3, 0.0)),
    ((0.5, 0.3, 5.0), (0.3, 0.0)),
    ((0.0, 1.6, 6.0), (0.0, 0.0)),
    ((-0.4, 0.8, 4.0), (0.2, 0.0)),
    ((0.4, 0.8, 4.0), (-0.2, 0.0)),
    ((0.0, 0.8, 12.0), (0.0, 0.3)),
    ((0.3, 1.0, 3.0), (0.0, 0.0)),
)
"""Of each demonstrator: a point to go to and for how many seconds, and where to come down."""

Array = NDArray[np.float64]


class Docking:
    """A `BatchedEnvironment`; what is true of its episodes stands in `rewards`, `lost` and `rested`."""

    observation_names, action_names = OBSERVATIONS, ACTIONS
    horizon = acting_steps = STEPS

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.floating]:
        """Start high above the pad."""
        shape = (strategies, episodes)
        spread = [rng.uniform(-0.5, 0.5, shape), 1.4 + rng.uniform(-0.1, 0.1, shape)]
        spread += [rng.normal(0.0, size, shape) for size in (0.3, 0.3, 0.1)]
        self._state = np.stack([*spread, np.zeros(shape)], axis=-1)
        self._contact = np.zeros(shape, dtype=bool)
        self._still = np.zeros(shape, dtype=int)
        self.lost = np.zeros(shape, dtype=bool)
        self.rested = np.zeros(shape, dtype=bool)
        self.rewards: list[Array] = []
        self._potential = self._shaping()
        return self._observation()

    def step(self, action: NDArray[np.floating]) -> NDArray[np.floating]:
        """Fly on."""
        push, turn = np.moveaxis(np.clip(np.asarray(action, dtype=float), -1.0, 1.0), -1, 0)
        before, lost_before = self._state, self.lost
        flown, fell, touching = _fly(before, np.maximum(push + 0.3, 0.0) * 1.8, turn)
        flown[lost_before] = before[lost_before]
        outside = lost_before & (np.abs(before[..., 0]) > HALF_WIDTH)
        flown[outside] = _fall(before)[outside]
        self._contact = np.where(lost_before, self._contact, touching & ~fell)
        self.lost = lost_before | fell
        self._state = flown
        slow = np.abs(flown[..., 2:4]).max(axis=-1) < 0.02
        self._still = np.where(slow & self._contact & ~lost_before, self._still + 1, 0)
        potential = self._shaping()
        paid = potential - self._potential - 0.3 * np.maximum(push, 0.0)
        self._potential = potential
        resting = (self._still > RESTING_STEPS) & ~self.lost
        self.rested |= resting
        self.rewards.append(np.where(self.lost, -100.0, np.where(resting, 100.0, paid)))
        return self._observation()

    def returns(self) -> Array:
        """True returns of the episodes, ``[S, K]``."""
        return np.asarray(np.sum(self.rewards, axis=0))

    def _observation(self) -> NDArray[np.floating]:
        legs = np.repeat(self._contact[..., None], 2, axis=-1)
        return np.concatenate([self._state, legs], axis=-1).astype(np.float32)

    def _shaping(self) -> Array:
        x, z, vx, vz, angle, _ = np.moveaxis(self._state, -1, 0)
        near = 100.0 * np.hypot(x, z) + 60.0 * np.hypot(vx, vz) + 100.0 * np.abs(angle)
        return np.asarray(20.0 * self._contact - near)


def _fly(state: Array, lift: Array, turn: Array) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """One step of the living: the state, who is lost by it, and who stands."""
    x, z, vx, vz, angle, omega = np.moveaxis(state, -1, 0)
    vx = vx + STEP_S * (-lift * np.sin(angle) - 0.05 * vx)
    vz = vz + STEP_S * (lift * np.cos(angle) - 1.0 - 0.05 * vz)
    omega = omega + STEP_S * (6.0 * turn - 0.6 * omega)
    x, z, angle = x + STEP_S * vx, z + STEP_S * vz, angle + STEP_S * omega
    down, soft = z <= 0.0, (np.abs(vz) < 0.6) & (np.abs(angle) < 0.4)
    crashed, touching = down & ~soft, down & soft
    z = np.where(down, 0.0, z)
    vz = np.where(touching & (vz < 0.0), -0.2 * vz * (np.abs(vz) > 0.1), vz)
    vx, omega, angle = (
        np.where(touching, keep * value, value) for keep, value in ((0.7, vx), (0.3, omega), (0.6, angle))
    )
    flown = np.stack([x, z, vx, vz, angle, omega], axis=-1)
    flown[crashed, 4] = np.clip(angle[crashed], -1.5, 1.5)
    flown[crashed, 2:4] = flown[crashed, 5:] = 0.0
    return flown, crashed | (np.abs(x) > HALF_WIDTH), touching & (np.abs(angle) < 0.2)


def _fall(state: Array) -> Array:
    """One step of whoever has left the bounds."""
    fallen = state.copy()
    fallen[..., 3] -= STEP_S
    fallen[..., :2] += STEP_S * fallen[..., 2:4]
    fallen[..., 4] += STEP_S * fallen[..., 5]
    return fallen


def demonstrator(
    way: int,
    step: int,
    observation: NDArray[np.floating],
    gain: Array | float = 1.0,
    slip: Array | float = 0.0,
) -> Array:
    """What demonstrator `way` does, ``[K, 2]``; with other gains and aims somebody who is bad at it.

    Parameters
    ----------
    observation
        ``[K, 8]``.
    """
    (via_x, via_z, until), (land_x, land_z) = WAYS[way]
    x, z, vx, vz, angle, omega, left, _ = np.moveaxis(np.asarray(observation, dtype=float), -1, 0)
    on_the_way = step * STEP_S < until
    wanted_x = (via_x if on_the_way else land_x) + slip
    wanted_z = (via_z if on_the_way else max(land_z - 0.05, -0.05)) + slip
    lean = np.clip(-gain * (1.2 * (wanted_x - x) - 1.6 * vx), -0.35, 0.35)
    climb = gain * (1.5 * np.clip(wanted_z - z, -0.25, 0.6) - 1.8 * vz)
    push = (1.0 + climb) / np.maximum(np.cos(angle), 0.5) / 1.8 - 0.3
    turn = (8.0 * (lean - angle) - 3.0 * omega) / 6.0
    standing = left > 0.5
    action = np.stack([np.where(standing, -1.0, push), np.where(standing, 0.0, turn)], axis=-1)
    return np.asarray(np.clip(action, -1.0, 1.0))
