"""The driver of the arm's joints: what a real arm's own controller does with `joint_command`.

Each millisecond it moves the reference along the command (`joint_reference`), and computes the torques
that follow it from the robot's model of itself plus a proportional-derivative correction, within the
torque limits. When a command is used up, the reference decelerates to a hold.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.core.errors import UserError
from msrd_ros.robots.arm_model import Arm, slowed
from msrd_ros.robots.dynamics import GRAVITY_M_S2, inverse_dynamics, inverse_dynamics_into
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.collision_model import obstacle
from msrd_ros.table_tennis.arm.reference import move_reference
from msrd_ros.table_tennis.ball.scene import Table

Array = NDArray[np.float64]

FOLLOWING_ERROR_RAD = 0.1
"""A joint so far from its reference has met something: the reference then starts anew from the arm."""


MOVES, STANDS, BLOCKED = 0, 1, 2
"""What `drive` says of the reference."""


@njit(cache=True, nogil=True)
def computed_torque(
    arm: Arm,
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
    """Write the joint torques (N,) in Nm that follow the reference into `torque`, within the limits.

    The measured velocity is the one that carried the joints through the last step, as Bullet integrates;
    so it is held against the reference's mean velocity over that step.

    Parameters
    ----------
    measured_position, measured_velocity
        State of the joints now, shape (N,), rad and rad/s.
    before, now, ahead
        Reference positions one step ago, now and one step ahead, shape (N,), rad.
    step
        Seconds.
    stiffness, damping
        Gains, 1/s^2 and 1/s.
    """
    count, friction, torque_limit = len(arm[0].speed), arm[0].friction, arm[0].torque
    wanted = np.empty(count)
    for joint in range(count):
        last = (now[joint] - before[joint]) / step
        coming = (ahead[joint] - now[joint]) / step
        change = (
            (coming - last) / step
            + stiffness * (now[joint] - measured_position[joint])
            + damping * (last - measured_velocity[joint])
        )
        # The correction may not carry a joint over its speed limit either.
        limit = arm[0].speed[joint]
        highest = (limit - measured_velocity[joint]) / step
        lowest = (-limit - measured_velocity[joint]) / step
        wanted[joint] = min(max(change, lowest), highest)
    inverse_dynamics_into(arm, measured_position, measured_velocity, wanted, GRAVITY_M_S2, torque)
    exceeded = False
    for joint in range(count):
        torque[joint] += friction[joint] * measured_velocity[joint]
        exceeded |= abs(torque[joint]) > torque_limit[joint]
    if exceeded:
        _spread(arm, measured_position, measured_velocity, torque)
    for joint in range(count):
        torque[joint] = min(max(torque[joint], -torque_limit[joint]), torque_limit[joint])


@njit(cache=True, nogil=True)
def _spread(arm: Arm, position: Array, velocity: Array, torque: Array) -> None:
    """Scale down, in place, what `torque` (N,) spends on accelerating, until the limits allow it.

    All joints then accelerate by the same share of what was wanted. If only the saturated ones gave less,
    the reaction of the others would make them run away.
    """
    count, torque_limit = len(arm[0].speed), arm[0].torque
    bias = inverse_dynamics(arm, position, velocity, np.zeros(count))
    share = 1.0
    for joint in range(count):
        bias[joint] += arm[0].friction[joint] * velocity[joint]
        effort = torque[joint] - bias[joint]
        room = torque_limit[joint] - math.copysign(bias[joint], effort * bias[joint])
        if abs(effort) * share > room:
            share = max(room, 0.0) / abs(effort)
    for joint in range(count):
        torque[joint] = bias[joint] + share * (torque[joint] - bias[joint])


@njit(cache=True, nogil=True)
def drive(
    arm: Arm,
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
        Shape (N,).
    before
        Reference position one step ago, shape (N,); changed.
    state, command, elapsed, period, step, table, carefree
        As of `move_reference`.
    gains
        Stiffness, damping, catch-up, shape (3,).
    torque
        Written, shape (N,).

    Returns
    -------
    int
        `MOVES`, `STANDS` if the reference stood still, or `BLOCKED`, and nothing was done, if the arm is far
        from its reference.
    """
    for joint in range(len(measured_position)):
        if abs(state[0, joint] - measured_position[joint]) > FOLLOWING_ERROR_RAD:
            return BLOCKED
    now = state[0].copy()
    move_reference(arm, state, command, elapsed, period, step, gains[2], table, carefree)
    computed_torque(
        arm,
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
    copy_onto(before, now)
    for joint in range(len(now)):
        if state[1, joint] != 0.0 or state[0, joint] != now[joint]:
            return MOVES
    return STANDS


class JointDriver:
    """Follows commands with torques.

    Parameters
    ----------
    robot
        Whose joints, of N.
    step_s
        Period of the torque loop.
    table
        To be kept clear of.
    limits_share
        What it allows of the robot's limits of speed and acceleration.
    dead_time_s
        How long after a command came it begins with it.
    """

    def __init__(
        self,
        robot: Robot,
        step_s: float,
        table: Table,
        limits_share: float = 1.0,
        dead_time_s: float = 0.0,
    ) -> None:
        self._robot = robot
        self._model = slowed(robot.model, limits_share)
        self._dead_steps = round(dead_time_s / step_s)
        self._late: deque[tuple[int, Array, int]] = deque()  # when it begins, goal (2, N), steps
        self._clock = 0
        count, gains = robot.joint_count, robot.driver
        self._gains = np.array([gains.stiffness_1_s2, gains.damping_1_s, gains.catch_up_1_s])
        self._step_s = step_s
        self._table = obstacle(table)
        self._carefree = np.zeros(1)
        self._before = np.zeros(count)
        self._state = np.zeros((2, count))
        self._command = np.zeros((4, count))
        self._steps_left = 0
        self._steps = 1
        self.reference_rests = True

    @property
    def reference(self) -> JointReference:
        """Where the joints shall be now."""
        return JointReference(self._state[0].copy(), self._state[1].copy())

    def hold_at(self, position: Array, velocity: Array | None = None) -> None:
        """Forget any command; the reference is at `position` (N,), and comes to rest if it moves."""
        self._before[:] = self._state[0] = position
        self._state[1] = 0.0
        if velocity is not None:
            fastest = self._model[0]["speed"]
            self._state[1] = np.clip(velocity, -fastest, fastest)
            self._before -= self._step_s * self._state[1]
        self._late.clear()
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
        limits, fastest = self._robot.limits, self._model[0]["speed"]
        goal = np.array([position, velocity], dtype=np.float64).reshape(2, self._robot.joint_count)
        if not np.isfinite(goal).all():
            joint = self._robot.joint_names[int(np.argwhere(~np.isfinite(goal))[0][1])]
            raise UserError(f"command for joint {joint} is not a finite number; the command is ignored")
        steps = round(period_s / self._step_s) if np.isfinite(period_s) else 0
        goal[0].clip(limits.lowest_rad, limits.highest_rad, out=goal[0])
        goal[1].clip(-fastest, fastest, out=goal[1])
        if steps < 1:
            raise UserError(f"command period is {period_s} s; send at least {self._step_s} s")
        if self.reference_rests and np.array_equal(goal, self._state):
            return  # told to stay where it is: rest is not disturbed
        self.reference_rests = False
        if self._dead_steps:
            self._late.append((self._clock + self._dead_steps, goal, steps))
        else:
            self._begin(goal, steps)

    def _begin(self, goal: Array, steps: int) -> None:
        self._command[0:2] = self._state
        self._command[2:4] = goal
        self._steps = self._steps_left = steps

    def torque(self, position: Array, velocity: Array, torque: Array) -> None:
        """Write the torques (N,) for the coming step, given the measured state (N,), into `torque`."""
        while self._late and self._late[0][0] <= self._clock:
            self._begin(*self._late.popleft()[1:])
        self._clock += 1
        if self._drive(position, velocity, torque) == BLOCKED:
            # Something is in the way: start anew from where the arm is, as a colliding robot stops.
            self.hold_at(position, velocity)
            self._drive(position, velocity, torque)

    def _drive(self, position: Array, velocity: Array, torque: Array) -> int:
        done = self._steps - self._steps_left + 1 if self._steps_left else self._steps + 1
        result: int = drive(
            self._model,
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
            self.reference_rests = result == STANDS and not self._steps_left and not self._late
        return result
