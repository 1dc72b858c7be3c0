"""The reference that the joints follow: on a command's curve, within every limit, and off the table.

Each step the reference moves on the cubic that leads from where it was to the commanded state (the
quadratic of constant acceleration, for a command that came out of `shape_command`), within the limits of
speed, acceleration and position whatever was commanded. A step from which the arm could not stop before
it touches table or floor is not taken: the joints brake instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import copy_onto, njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.limits import next_velocity
from msrd_ros.table_tennis.arm.collision_model import MARGIN_M, braking_clearance

Array = NDArray[np.float64]

_ARRIVED = 1e-6
"""Rounding left between reference and command in rad and rad/s, below which they are made equal."""
_CAREFREE_STEPS = 4
_CAREFREE_M = MARGIN_M + 0.04
"""With so much room no paddle at 4.5 m/s gets into the margin within so many milliseconds."""


@njit(cache=True, nogil=True)
def curve_velocity(
    position: float,
    velocity: float,
    start: float,
    start_velocity: float,
    goal: float,
    goal_velocity: float,
    share: float,
    period: float,
    step: float,
    catch_up: float,
) -> float:
    """Velocity in rad/s that takes one joint's reference to its command's cubic within this step.

    Parameters
    ----------
    position, velocity
        Of the reference.
    start, start_velocity, goal, goal_velocity
        Both ends of the cubic.
    share
        Of the command's `period` that has passed at the end of the step.
    step
        Seconds.
    catch_up
        Gain 1/s on what the reference was held back by limits.
    """
    m0, m1 = start_velocity * period, goal_velocity * period
    # Hermite cubic about its start: of a quadratic no cubic part is left by rounding.
    b = 3.0 * (goal - start) - 2.0 * m0 - m1
    c = m0 + m1 - 2.0 * (goal - start)
    place = start + share * (m0 + share * (b + share * c))
    slope = (m0 + share * (2.0 * b + share * 3.0 * c)) / period
    return slope + catch_up * (place - position - 0.5 * (velocity + slope) * step)


@njit(cache=True, nogil=True)
def _take(arm: Arm, position: Array, velocity: Array, wanted: Array, step: float, ahead: Array) -> None:
    """Write the state one step ahead, (2, N), that comes nearest to the `wanted` velocities (N,)."""
    for joint in range(len(arm[0].speed)):
        faster = next_velocity(
            position[joint],
            velocity[joint],
            wanted[joint],
            arm[0].lowest[joint],
            arm[0].highest[joint],
            arm[0].speed[joint],
            arm[0].acceleration[joint],
            step,
        )
        ahead[0, joint] = position[joint] + 0.5 * (velocity[joint] + faster) * step
        ahead[1, joint] = faster


@njit(cache=True, nogil=True)
def _land(ahead: Array, goal: Array) -> None:
    """Take rounding away at the end of a command that was followed to the end."""
    for joint in range(len(goal[0])):
        near = abs(ahead[0, joint] - goal[0, joint]) < _ARRIVED
        if near and abs(ahead[1, joint] - goal[1, joint]) < _ARRIVED:
            ahead[0, joint], ahead[1, joint] = goal[0, joint], goal[1, joint]


@njit(cache=True, nogil=True)
def move_reference(
    arm: Arm,
    state: Array,
    command: Array,
    elapsed: float,
    period: float,
    step: float,
    catch_up: float,
    table: Array,
    carefree: Array,
) -> None:
    """Move the reference, in place, by one step.

    Parameters
    ----------
    arm
        `Robot.model`, of N joints.
    state
        Position and velocity of the reference, shape (2, N), rad and rad/s; changed.
    command
        Start position, start velocity, goal position, goal velocity, shape (4, N).
    elapsed
        Since the command's start, at the end of this step, s. Past `period` the reference comes to rest.
    period, step
        Seconds.
    catch_up
        See `curve_velocity`.
    table
        Of `collision_model.obstacle`.
    carefree
        Steps until the way ahead has to be looked at again, shape (1,); changed, zero to begin with.
    """
    count = len(arm[0].speed)
    wanted = np.zeros(count)
    active = elapsed <= period + 0.5 * step
    share = min(elapsed / period, 1.0)
    if active:
        for joint in range(count):
            wanted[joint] = curve_velocity(
                state[0, joint],
                state[1, joint],
                command[0, joint],
                command[1, joint],
                command[2, joint],
                command[3, joint],
                share,
                period,
                step,
                catch_up,
            )
    ahead = np.empty((2, count))
    _take(arm, state[0], state[1], wanted, step, ahead)
    if active and share == 1.0:
        _land(ahead, command[2:])
    if carefree[0] > 0.0:
        carefree[0] -= 1.0
    else:
        room = braking_clearance(arm, ahead[0], ahead[1], table)
        if room > _CAREFREE_M:
            carefree[0] = _CAREFREE_STEPS
        elif room < MARGIN_M:
            braked = np.empty((2, count))
            _take(arm, state[0], state[1], np.zeros(count), step, braked)
            # Within the margin, any way that leads out is better than staying.
            if room <= braking_clearance(arm, braked[0], braked[1], table):
                ahead = braked
    copy_onto(state[0], ahead[0])
    copy_onto(state[1], ahead[1])
