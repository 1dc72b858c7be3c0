"""One recorded stroke as many: what its teacher would have done against the balls that others met.

A recording says how its teacher moves, but not how the motion changes with the ball; known strategies do. So
a known policy is played, without a simulator, against the ball that the recording shows and against others',
and how the recorded joints depart from it, tick by tick, is added to what it does against each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, observe
from msrd_ros.learning.policy import Policy
from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]

_SUM_WEIGHT = 100.0


class Motions(NamedTuple):
    """Strokes against B balls: observations ``[B, T+1, N+6]`` and actions ``[B, T_act, N]``."""

    observations: Array
    actions: Array


def nearest_weights(policies: Sequence[Policy], observations: Array, actions: Array) -> dict[str, float]:
    """Weights, by name, with which policies together do most nearly what was recorded.

    Least squares with weights that are not negative and sum to 1; 0 is left out.

    Parameters
    ----------
    observations, actions
        ``[M, T+1, N+6]`` and ``[M, T_act, N]``, from the first acting step on.
    """
    seen = observations[:, : actions.shape[1]]
    columns = np.stack(
        [np.asarray(policy.act(seen), dtype=np.float64).ravel() for policy in policies], axis=1
    )
    # A heavy row for the sum; what is left of it is divided out.
    heavy = _SUM_WEIGHT * np.abs(columns).max() * np.sqrt(len(columns))
    found, _ = nnls(np.vstack([columns, np.full(len(policies), heavy)]), np.append(actions.ravel(), heavy))
    shares = found / found.sum()
    return {policy.label: float(share) for policy, share in zip(policies, shares, strict=True) if share > 0.0}


def departure_of(robot: Robot, base: Callable[[Array], Array], ready_pose: Array, shown: Array) -> Array:
    """How recorded joints depart from what a known policy does against the same balls, ``[T_act+1, N]``, rad.

    Parameters
    ----------
    robot
        The arm, of N joints.
    base
        The known policy: from observations ``[..., N+6]`` to actions ``[..., N]``.
    ready_pose
        Where its joints wait, ``[N]``, rad.
    shown
        Observations ``[M, T+1, N+6]`` of the recorded strokes, from the first acting step on; their
        departures are averaged.
    """
    joints = robot.joint_count
    followed, _ = _follow(robot, base, ready_pose, shown[..., joints:])
    return np.asarray((shown[:, : ACTING_STEPS + 1, :joints] - followed).mean(axis=0))


def depart(
    robot: Robot, base: Callable[[Array], Array], ready_pose: Array, departure: Array, balls: Array
) -> Motions:
    """Strokes that depart from a known policy so, against other balls.

    Parameters
    ----------
    robot, base, ready_pose, departure
        As of `departure_of`.
    balls
        Ball columns ``[B, T+1, 6]`` of strokes on the same side.
    """
    position, action = _follow(robot, base, ready_pose, balls)
    position = position + departure
    action = action + departing_rates(robot, departure)
    rest = np.repeat(position[:, -1:], balls.shape[1] - position.shape[1], axis=1)
    everything = np.concatenate([position, rest], axis=1)
    return Motions(
        observe(everything, balls[..., :3], balls[..., 3:]), np.asarray(np.clip(action, -1.0, 1.0))
    )


def departing_rates(robot: Robot, departure: Array) -> Array:
    """What a departure adds to the actions, ``[T_act, N]``."""
    return np.asarray(np.diff(departure, axis=0) / (CONTROL_PERIOD_S * robot.limits.speed_rad_s))


def _follow(
    robot: Robot, base: Callable[[Array], Array], ready_pose: Array, balls: Array
) -> tuple[Array, Array]:
    """Joints ``[B, T_act+1, N]`` and actions ``[B, T_act, N]`` of an arm that follows exactly."""
    step_rad = CONTROL_PERIOD_S * robot.limits.speed_rad_s
    positions, actions = [np.repeat(ready_pose[None], len(balls), axis=0)], []
    for step in range(ACTING_STEPS):
        seen = observe(positions[-1], balls[:, step, :3], balls[:, step, 3:])
        actions.append(np.clip(base(seen), -1.0, 1.0))
        positions.append(positions[-1] + actions[-1] * step_rad)
    return np.stack(positions, axis=1), np.stack(actions, axis=1)
