"""The driver of the arm's joints: what a real arm's own controller does with `joint_command`.

Each millisecond it moves the reference along the command (`joint_reference`), and computes the torques
that follow it from the robot's model of itself plus a proportional-derivative correction, within the
torque limits. When a command is used up, the reference decelerates to a hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.dynamics import (
    GRAVITY_M_S2,
    JOINT_FRICTION_NM_S,
    inverse_dynamics,
    inverse_dynamics_into,
)
from msrd_ros.robots.limits import HIGHEST_RAD, LOWEST_RAD, JointReference
from msrd_ros.robots.sawyer import JOINT_COUNT, JOINT_NAMES, SPEED_LIMIT_RAD_S, TORQUE_LIMIT_NM
from msrd_ros.table_tennis.arm.collision_model import obstacle
from msrd_ros.table_tennis.arm.reference import move_reference
from msrd_ros.table_tennis.ball.scene import Table

Array = NDArray[np.float64]

FOLLOWING_ERROR_RAD = 0.1
"""A joint so far from its reference has met something: the reference then starts anew from the arm."""


MOVES, STANDS, BLOCKED = 0, 1, 2
"""What `drive` says of the reference."""


@dataclass(frozen=True)
class DriverGains:
    """RecoveryLabel of tracking errors as accelerations, so that every joint is equally stiff.

    Attributes
    ----------
    stiffness_1_s2, damping_1_s
        Per rad of error and per rad/s; critically damped by default.
    catch_up_1_s
        How fast a reference that the limits held back closes up to the commanded curve.
    """

    stiffness_1_s2: float = 10_000.0
    damping_1_s: float = 200.0
    catch_up_1_s: float = 50.0


@njit(cache=True, nogil=True)
def computed_torque(
    measured_position: Array,
    measured_velocity: Array,
    before: Array,
    now: Array,
    ahead: Array,
    step: float,
    stiffness: float,
    damping: float,
    torque: Array,
) -> None:
    """Write the joint torques (7,) in Nm that follow the reference into `torque`, within the limits.

    The measured velocity is the one that carried the joints through the last step, as Bullet integrates;
    so it is held against the reference's mean velocity over that step.

    Parameters
    ----------
    measured_position, measured_velocity
        State of the joints now, shape (7,), rad and rad/s.
    before, now, ahead
        Reference positions one step ago, now and one step ahead, shape (7,), rad.
    step
        Seconds.
    stiffness, damping
        Gains, 1/s^2 and 1/s.
    """
    wanted = np.empty(JOINT_COUNT)
    for joint in range(JOINT_COUNT):
        last = (now[joint] - before[joint]) / step
        coming = (ahead[joint] - now[joint]) / step
        change = (
            (coming - last) / step
            + stiffness * (now[joint] - measured_position[joint])
            + damping * (last - measured_velocity[joint])
        )
        # The correction may not carry a joint over its speed limit either.
        limit = SPEED_LIMIT_RAD_S[joint]
        highest = (limit - measured_velocity[joint]) / step
        lowest = (-limit - measured_velocity[joint]) / step
        wanted[joint] = min(max(change, lowest), highest)
    inverse_dynamics_into(measured_position, measured_velocity, wanted, GRAVITY_M_S2, torque)
    needed = JOINT_FRICTION_NM_S * measured_velocity
    needed += torque
    if np.any(np.abs(needed) > TORQUE_LIMIT_NM):
        _spread(measured_position, measured_velocity, needed)
    torque[:] = np.minimum(np.maximum(needed, -TORQUE_LIMIT_NM), TORQUE_LIMIT_NM)


@njit(cache=True, nogil=True)
def _spread(position: Array, velocity: Array, torque: Array) -> None:
    """Scale down, in place, what `torque` (7,) spends on accelerating, until the limits allow it.

    All joints then accelerate by the same share of what was wanted. If only the saturated ones gave less,
    the reaction of the others would make them run away.
    """
    bias = inverse_dynamics(position, velocity, np.zeros(JOINT_COUNT)) + JOINT_FRICTION_NM_S * velocity
    share = 1.0
    for joint in range(JOINT_COUNT):
        effort = torque[joint] - bias[joint]
        room = TORQUE_LIMIT_NM[joint] - math.copysign(bias[joint], effort * bias[joint])
        if abs(effort) * share > room:
            share = max(room, 0.0) / abs(effort)
    torque[:] = bias + share * (torque - bias)


@njit(cache=True, nogil=True)
def drive(
    measured_position: Array,
    measured_velocity: Array,
    before: Array,
    state: Array,
    command: Array,
    elapsed: float,
    period: float,
    step: float,
    gains: Array,
    table: Array,
    carefree: Array,
    torque: Array,
) -> int:
    """One step of the driver: move the reference and write the torques.

    Parameters
    ----------
    measured_position, measured_velocity
        Shape (7,).
    before
        Reference position one step ago, shape (7,); changed.
    state, command, elapsed, period, step, table, carefree
        As of `move_reference`.
    gains
        Stiffness, damping, catch-up, shape (3,).
    torque
        Written, shape (7,).

    Returns
    -------
    int
        `MOVES`, `STANDS` if the reference stood still, or `BLOCKED`, and nothing was done, if the arm is far
        from its reference.
    """
    for joint in range(JOINT_COUNT):
        if abs(state[0, joint] - measured_position[joint]) > FOLLOWING_ERROR_RAD:
            return BLOCKED
    now = state[0].copy()
    move_reference(state, command, elapsed, period, step, gains[2], table, carefree)
    computed_torque(
        measured_position,
        measured_velocity,
        before,
        now,
        state[0],
        step,
        gains[0],
        gains[1],
        torque,
    )
    before[:] = now
    stands = np.all(state[1] == 0.0) and np.all(state[0] == now)
    return STANDS if stands else MOVES


class JointDriver:
    """Follows commands with torques.

    Parameters
    ----------
    step_s
        Period of the torque loop.
    table
        To be kept clear of.
    gains
        Of the correction.
    """

    def __init__(self, step_s: float, table: Table, gains: DriverGains | None = None) -> None:
        gains = gains or DriverGains()
        self._gains = np.array([gains.stiffness_1_s2, gains.damping_1_s, gains.catch_up_1_s])
        self._step_s = step_s
        self._table = obstacle(table)
        self._carefree = np.zeros(1)
        self._before = np.zeros(JOINT_COUNT)
        self._state = np.zeros((2, JOINT_COUNT))
        self._command = np.zeros((4, JOINT_COUNT))
        self._steps_left = 0
        self._steps = 1
        self.reference_rests = True

    @property
    def reference(self) -> JointReference:
        """Where the joints shall be now."""
        return JointReference(self._state[0].copy(), self._state[1].copy())

    def hold_at(self, position: Array, velocity: Array | None = None) -> None:
        """Forget any command; the reference is at `position` (7,), and comes to rest if it moves."""
        self._before[:] = self._state[0] = position
        self._state[1] = 0.0
        if velocity is not None:
            self._state[1] = np.clip(velocity, -SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S)
            self._before -= self._step_s * self._state[1]
        self._steps_left = 0
        self._carefree[0] = 0.0
        self.reference_rests = velocity is None

    def command(self, position: Array, velocity: Array, period_s: float) -> None:
        """Head for a state of the joints, to be reached after `period_s` seconds.

        A state beyond the limits of position or speed is taken as the nearest one within them.

        Raises
        ------
        UserError
            If a number is not finite (the message names the joint), or the period is not positive.
        """
        goal = np.array([position, velocity], dtype=np.float64).reshape(2, JOINT_COUNT)
        if not np.isfinite(goal).all():
            joint = JOINT_NAMES[int(np.argwhere(~np.isfinite(goal))[0][1])]
            raise UserError(f"command for joint {joint} is not a finite number; the command is ignored")
        steps = round(period_s / self._step_s) if np.isfinite(period_s) else 0
        goal[0].clip(LOWEST_RAD, HIGHEST_RAD, out=goal[0])
        goal[1].clip(-SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S, out=goal[1])
        if steps < 1:
            raise UserError(f"command period is {period_s} s; send at least {self._step_s} s")
        if self.reference_rests and np.array_equal(goal, self._state):
            return  # told to stay where it is: rest is not disturbed
        self._command[0:2] = self._state
        self._command[2:4] = goal
        self._steps = self._steps_left = steps
        self.reference_rests = False

    def torque(self, position: Array, velocity: Array, torque: Array) -> None:
        """Write the torques (7,) for the coming step, given the measured state (7,), into `torque`."""
        if self._drive(position, velocity, torque) == BLOCKED:
            # Something is in the way: start anew from where the arm is, as a colliding robot stops.
            self.hold_at(position, velocity)
            self._drive(position, velocity, torque)

    def _drive(self, position: Array, velocity: Array, torque: Array) -> int:
        done = self._steps - self._steps_left + 1 if self._steps_left else self._steps + 1
        result: int = drive(
            position,
            velocity,
            self._before,
            self._state,
            self._command,
            done * self._step_s,
            self._steps * self._step_s,
            self._step_s,
            self._gains,
            self._table,
            self._carefree,
            torque,
        )
        if result != BLOCKED:
            self._steps_left = max(self._steps_left - 1, 0)
            self.reference_rests = result == STANDS and not self._steps_left
        return result
