"""One stroke as arrays: what learning sees of a demonstration or of a rollout."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import WITHOUT_LABEL, StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot

CONTROL_PERIOD_S = 0.02
"""Period of the policies' control loop."""

HORIZON = 95
"""Steps of an episode: 1.9 s from the launch, long enough to see where the returned ball lands."""

FIRST_ACTING_STEP = 1
"""The ball's velocity is known from its second sample on, so the first step holds still."""

ACTING_STEPS = 62
"""Steps in which the policy acts; afterwards the arm comes to rest while the ball flies on."""

BALL_NAMES: tuple[str, ...] = (
    "ball_x_m",
    "ball_y_m",
    "ball_z_m",
    "ball_velocity_x_m_s",
    "ball_velocity_y_m_s",
    "ball_velocity_z_m_s",
)
"""Columns of the observation that tell of the ball: all that the task reward sees."""

PADDLE_NAMES: tuple[str, ...] = (
    "paddle_x_m",
    "paddle_y_m",
    "paddle_z_m",
    "paddle_normal_x",
    "paddle_normal_y",
    "paddle_normal_z",
    "paddle_velocity_x_m_s",
    "paddle_velocity_y_m_s",
    "paddle_velocity_z_m_s",
)
"""What the ball feels of the arm, in `world`: the blade's centre, the normal of its front face, and how the
centre moves. Strategy rewards see it instead of joints, so that they are of no arm."""


def observation_names(robot: Robot) -> tuple[str, ...]:
    """What a policy sees. Joint rates are left out on purpose: a cloned policy would copy its own motion."""
    return (*robot.joint_names, *BALL_NAMES)


def action_names(robot: Robot) -> tuple[str, ...]:
    """What a policy says: each joint's velocity as a fraction of its speed limit."""
    return tuple(f"{name}_speed_fraction" for name in robot.joint_names)


def observe(
    joint_position: NDArray[np.float64],
    ball_position: NDArray[np.float64],
    ball_velocity: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Put an observation together: (..., N), (..., 3) and (..., 3) to (..., N + 6), in SI units."""
    return np.concatenate([joint_position, ball_position, ball_velocity], axis=-1)


def action_to_velocity(robot: Robot, action: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint velocity in rad/s that an action (..., N) asks for; beyond [-1, 1] it is clipped."""
    return np.clip(action, -1.0, 1.0) * robot.limits.speed_rad_s


@dataclass(frozen=True)
class Episode:
    """One stroke, sampled at the control rate from the launch of the ball.

    Attributes
    ----------
    label
        The strategy that was shown or played; None if nobody has said which.
    joint_position, joint_velocity
        Shape (T + 1, N), rad and rad/s, as measured.
    ball_position, ball_velocity
        Shape (T + 1, 3), m and m/s, as a camera sees them.
    subject
        Who showed it; empty for the robot itself.
    source
        Where it comes from (a bag's path, a topic), for error messages.
    outcome
        What became of the ball, if a referee said so; for reports, never an input to learning.
    robot
        Whose joints they are, N of them.
    start_ns
        Stamp of the first row, by the clock of the messages; None where there were none.
    """

    label: StrategyLabel | None
    joint_position: NDArray[np.float64]
    joint_velocity: NDArray[np.float64]
    ball_position: NDArray[np.float64]
    ball_velocity: NDArray[np.float64]
    subject: str = ""
    source: str = ""
    outcome: Outcome | None = None
    robot: Robot = field(default_factory=default_robot)
    start_ns: int | None = None

    @property
    def strategy(self) -> StrategyLabel:
        """Its label, where one is needed.

        Raises
        ------
        UserError
            If it has none; names its source and the ways out.
        """
        if self.label is None:
            raise UserError(f"{self.source or 'a stroke'}: {WITHOUT_LABEL}")
        return self.label

    @property
    def observations(self) -> NDArray[np.float64]:
        """Observations, shape (T + 1, N + 6), in the order of `observation_names`."""
        return observe(self.joint_position, self.ball_position, self.ball_velocity)

    @property
    def actions(self) -> NDArray[np.float64]:
        """Actions that lead from each state to the next, shape (T, N).

        A command asks for the velocity at the end of its period, so the action of step t is the
        velocity measured at t + 1 as a fraction of the speed limit.
        """
        return np.clip(self.joint_velocity[1:] / self.robot.limits.speed_rad_s, -1.0, 1.0)
