"""The driver of the arm's joints: what a real arm's own controller does with `joint_command`.

Each millisecond the reference moves on the cubic that leads from where it is to the commanded state
(the quadratic of constant acceleration, for a command that came out of `shape_command`), within the
limits of speed, acceleration and position whatever was commanded. When a command is used up, the
reference decelerates to a hold. Torques are computed from the robot's model of itself plus a
proportional-derivative correction, clipped to the torque limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from msrd_ros.facts.errors import UserError
from msrd_ros.facts.motion_limits import (
    ACCELERATION_LIMIT_RAD_S2,
    POSITION_MARGIN_RAD,
    JointReference,
    next_velocity,
)
from msrd_ros.facts.sawyer import (
    JOINT_COUNT,
    JOINT_NAMES,
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    SPEED_LIMIT_RAD_S,
    TORQUE_LIMIT_NM,
)
from msrd_ros.table_tennis.dynamics import GRAVITY_M_S2, JOINT_FRICTION_NM_S, inverse_dynamics_into

Array = NDArray[np.float64]

_LOWER = POSITION_LOWER_RAD + POSITION_MARGIN_RAD
_UPPER = POSITION_UPPER_RAD - POSITION_MARGIN_RAD
_ARRIVED = 1e-6
"""Rounding left between reference and command in rad and rad/s, below which they are made equal."""


@dataclass(frozen=True)
class DriverGains:
    """Correction of tracking errors as accelerations, so that every joint is equally stiff.

    `stiffness_1_s2` per rad of error, `damping_1_s` per rad/s; critically damped by default.
    """

    stiffness_1_s2: float = 10_000.0
    damping_1_s: float = 200.0
    catch_up_1_s: float = 50.0
    """How fast a reference that the limits held back closes up to the commanded curve."""


@njit(cache=True, nogil=True)
def move_reference(
    position: Array,
    velocity: Array,
    start_position: Array,
    start_velocity: Array,
    goal_position: Array,
    goal_velocity: Array,
    elapsed: float,
    period: float,
    step: float,
    catch_up: float,
) -> None:
    """Move the reference, in place, by one `step` to the time `elapsed` of a command of `period` seconds.

    Parameters
    ----------
    position, velocity
        The reference, shape (7,); changed.
    start_position, start_velocity, goal_position, goal_velocity
        Both ends of the command's cubic, shape (7,).
    elapsed
        Since the command's start, at the end of this step, s. Past `period` the reference comes to rest.
    period, step
        Seconds.
    catch_up
        Gain 1/s on the distance between reference and cubic.
    """
    active = elapsed <= period + 0.5 * step
    s = min(elapsed / period, 1.0)
    for joint in range(JOINT_COUNT):
        wanted = 0.0
        if active:
            p0, p1 = start_position[joint], goal_position[joint]
            m0, m1 = start_velocity[joint] * period, goal_velocity[joint] * period
            # Hermite cubic about its start, so that a quadratic comes out without rounding noise.
            b = 3.0 * (p1 - p0) - 2.0 * m0 - m1
            c = m0 + m1 - 2.0 * (p1 - p0)
            curve = p0 + s * (m0 + s * (b + s * c))
            slope = (m0 + s * (2.0 * b + s * 3.0 * c)) / period
            behind = curve - position[joint] - 0.5 * (velocity[joint] + slope) * step
            wanted = slope + catch_up * behind
        faster = next_velocity(
            position[joint],
            velocity[joint],
            wanted,
            _LOWER[joint],
            _UPPER[joint],
            SPEED_LIMIT_RAD_S[joint],
            ACCELERATION_LIMIT_RAD_S2[joint],
            step,
        )
        position[joint] += 0.5 * (velocity[joint] + faster) * step
        velocity[joint] = faster
    if active and s == 1.0:
        _land(position, velocity, goal_position, goal_velocity)


@njit(cache=True, nogil=True)
def _land(position: Array, velocity: Array, goal_position: Array, goal_velocity: Array) -> None:
    """Take rounding away at the end of a command that was followed to the end."""
    for joint in range(JOINT_COUNT):
        if (
            abs(position[joint] - goal_position[joint]) < _ARRIVED
            and abs(velocity[joint] - goal_velocity[joint]) < _ARRIVED
        ):
            position[joint] = goal_position[joint]
            velocity[joint] = goal_velocity[joint]


@njit(cache=True, nogil=True)
def computed_torque(
    measured_position: Array,
    measured_velocity: Array,
    reference_before: Array,
    reference_now: Array,
    reference_next: Array,
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
    reference_before, reference_now, reference_next
        Reference positions one step ago, now and one step ahead, shape (7,), rad.
    step
        Seconds.
    stiffness, damping
        Gains, 1/s^2 and 1/s.
    """
    wanted = np.empty(JOINT_COUNT)
    for joint in range(JOINT_COUNT):
        last = (reference_now[joint] - reference_before[joint]) / step
        coming = (reference_next[joint] - reference_now[joint]) / step
        wanted[joint] = (
            (coming - last) / step
            + stiffness * (reference_now[joint] - measured_position[joint])
            + damping * (last - measured_velocity[joint])
        )
    inverse_dynamics_into(measured_position, measured_velocity, wanted, GRAVITY_M_S2, torque)
    for joint in range(JOINT_COUNT):
        limit = TORQUE_LIMIT_NM[joint]
        wanted_torque = torque[joint] + JOINT_FRICTION_NM_S[joint] * measured_velocity[joint]
        torque[joint] = min(max(wanted_torque, -limit), limit)


@njit(cache=True, nogil=True)
def drive(
    measured_position: Array,
    measured_velocity: Array,
    reference: Array,
    command: Array,
    elapsed: float,
    period: float,
    step: float,
    gains: Array,
    torque: Array,
) -> bool:
    """One step of the driver: move the reference and write the torques.

    Parameters
    ----------
    measured_position, measured_velocity
        Shape (7,).
    reference
        Rows: position one step ago, position, velocity; shape (3, 7), changed.
    command
        Rows: start position, start velocity, goal position, goal velocity; shape (4, 7).
    elapsed
        Of the command, at the end of this step; larger than `period` when it is used up.
    gains
        Stiffness, damping, catch-up, shape (3,).
    torque
        Written, shape (7,).

    Returns
    -------
    bool
        Whether the reference stands still after this step.
    """
    before = reference[0].copy()
    now = reference[1].copy()
    move_reference(
        reference[1],
        reference[2],
        command[0],
        command[1],
        command[2],
        command[3],
        elapsed,
        period,
        step,
        gains[2],
    )
    computed_torque(
        measured_position,
        measured_velocity,
        before,
        now,
        reference[1],
        step,
        gains[0],
        gains[1],
        torque,
    )
    reference[0] = now
    still = True
    for joint in range(JOINT_COUNT):
        if reference[2, joint] != 0.0 or reference[1, joint] != now[joint]:
            still = False
    return still


class JointDriver:
    """Follows commands with torques.

    Parameters
    ----------
    step_s
        Period of the torque loop.
    """

    def __init__(self, step_s: float, gains: DriverGains | None = None) -> None:
        gains = gains or DriverGains()
        self._gains = np.array([gains.stiffness_1_s2, gains.damping_1_s, gains.catch_up_1_s])
        self._step_s = step_s
        self._reference = np.zeros((3, JOINT_COUNT))
        self._command = np.zeros((4, JOINT_COUNT))
        self._steps_left = 0
        self._steps = 1
        self.reference_rests = True

    @property
    def reference(self) -> JointReference:
        """Where the joints shall be now."""
        return JointReference(self._reference[1].copy(), self._reference[2].copy())

    @property
    def has_command(self) -> bool:
        """Whether a command is still being followed."""
        return self._steps_left > 0

    def hold_at(self, position: Array, velocity: Array | None = None) -> None:
        """Forget any command; the reference is at `position` (7,), and comes to rest if it moves."""
        self._reference[0] = position
        self._reference[1] = position
        self._reference[2] = 0.0 if velocity is None else velocity
        if velocity is not None:
            self._reference[0] -= self._step_s * velocity
        self._steps_left = 0
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
        goal[0].clip(_LOWER, _UPPER, out=goal[0])
        goal[1].clip(-SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S, out=goal[1])
        if steps < 1:
            raise UserError(f"command period is {period_s} s; send at least {self._step_s} s")
        if self.reference_rests and np.array_equal(goal, self._reference[1:3]):
            return  # told to stay where it is: rest is not disturbed
        self._command[0:2] = self._reference[1:3]
        self._command[2:4] = goal
        self._steps = self._steps_left = steps
        self.reference_rests = False

    def torque(self, position: Array, velocity: Array, torque: Array) -> None:
        """Write the torques (7,) for the coming step, given the measured state (7,), into `torque`."""
        done = self._steps - self._steps_left + 1 if self._steps_left else self._steps + 1
        still = drive(
            position,
            velocity,
            self._reference,
            self._command,
            done * self._step_s,
            self._steps * self._step_s,
            self._step_s,
            self._gains,
            torque,
        )
        if self._steps_left:
            self._steps_left -= 1
        self.reference_rests = still and not self._steps_left
