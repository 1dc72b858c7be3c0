"""Teach mode: the arm floats in zero-g and a hand leads the paddle.

Hand and paddle are held together by a spring-damper of limited force. The motors carry the arm's weight,
damp the joints a little, and brake every joint that comes near its speed limit; whatever they do, they
keep to their torque limits. The hand's wrench acts on the paddle from outside, beside the motors. An arm
that nobody leads is held by its driver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import quaternion_from_rotation, rotation_from_quaternion, turn_between, turned
from msrd_ros.table_tennis.simulation.gravity_compensation import Floating, Grip, float_step
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture, gesture_at

__all__ = ["GuidanceConfig", "HandGesture", "HandGuidance", "compile_ahead"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GuidanceConfig:
    """How firmly the hand holds the paddle; how the arm gives way is the robot's (`FloatingModel`).

    Attributes
    ----------
    stiffness_n_m, damping_n_s_m, force_limit_n
        Of the grip in translation.
    turn_stiffness_nm, turn_damping_nm_s, torque_limit_nm
        Of the grip in rotation, per rad and rad/s.
    hand_timeout_s
        A streamed hand that has not been heard of for so long has let go.
    """

    stiffness_n_m: float = 1500.0
    damping_n_s_m: float = 60.0
    force_limit_n: float = 150.0
    turn_stiffness_nm: float = 40.0
    turn_damping_nm_s: float = 1.2
    torque_limit_nm: float = 12.0
    hand_timeout_s: float = 0.1


class HandGuidance:
    """The hand, while there is one, and the floating arm's answer to it."""

    def __init__(self, robot: Robot, config: GuidanceConfig, step_s: float) -> None:
        self._robot = robot
        self._config = config
        self._step_s = step_s
        self._grip = Grip(
            np.repeat([config.stiffness_n_m, config.turn_stiffness_nm], 3),
            np.repeat([config.damping_n_s_m, config.turn_damping_nm_s], 3),
            config.force_limit_n,
            config.torque_limit_nm,
        )
        floating = robot.floating
        damping = np.array(floating.joint_damping_nm_s)
        self._floating = Floating(damping, floating.brake_from, floating.brake_full)
        self.leading = False
        self._start_s = 0.0
        self._times: Array = np.zeros(1)
        self._positions: Array = np.zeros((1, 3))
        self._rotations: Array = np.zeros((1, 3, 3))
        self._twists: Array = np.zeros((1, 6))

    def release(self) -> None:
        """Let go."""
        self.leading = False

    def lead(self, time_s: float, gesture: HandGesture) -> None:
        """Lead the paddle to or through `gesture`, whose times count from `time_s`."""
        self._start_s = time_s
        self._times = np.ascontiguousarray(gesture.times_s, dtype=np.float64)
        self._positions = np.ascontiguousarray(gesture.positions, dtype=np.float64)
        self._rotations = np.array([rotation_from_quaternion(one) for one in gesture.quaternions])
        self._twists = np.concatenate([gesture.velocities, gesture.angular_velocities], axis=1)
        self.leading = True

    def target(self, time_s: float) -> tuple[Array, Array, Array]:
        """Position (3,), rotation (3, 3) and twist (6,) of the hand."""
        elapsed = time_s - self._start_s
        if len(self._times) > 1:
            return gesture_at(self._times, self._positions, self._rotations, self._twists, elapsed)
        twist = self._twists[0]
        elapsed -= float(self._times[0])
        return (
            self._positions[0] + elapsed * twist[:3],
            turned(self._rotations[0], elapsed * twist[3:]),
            twist,
        )

    def holds_on(self, time_s: float) -> bool:
        """Whether the hand still leads; one that was streamed and fell silent has let go."""
        if self.leading and len(self._times) == 1:
            self.leading = time_s - self._start_s - self._times[0] <= self._config.hand_timeout_s
        return self.leading

    def torque(self, time_s: float, position: Array, velocity: Array, motor: Array, total: Array) -> None:
        """Write the torques of an arm that is led: the motors', and their sum with the hand's, shape (N,)."""
        centre, rotation, twist = self.target(time_s + self._step_s)
        here, turned_here = paddle_pose(self._robot.model, position)
        lead = np.empty(6)
        lead[:3] = centre - here
        lead[3:] = turn_between(turned_here, rotation)
        float_step(
            self._robot.model,
            position,
            velocity,
            lead,
            twist,
            self._grip,
            self._floating,
            self._step_s,
            motor,
            total,
        )
        total += motor


def compile_ahead(robot: Robot) -> None:
    """Lead an arm without a simulator, so that nothing has to be compiled once a hand takes it."""
    guidance = HandGuidance(robot, GuidanceConfig(), 0.001)
    home, still = robot.home_rad.copy(), np.zeros(robot.joint_count)
    position, rotation = paddle_pose(robot.model, home)
    here = HandGesture.now(position, quaternion_from_rotation(rotation))
    parts = here.positions, here.quaternions, here.velocities, here.angular_velocities
    path = HandGesture(np.array([0.0, 1.0]), *(np.repeat(part, 2, axis=0) for part in parts))
    for gesture in (here, path):
        guidance.lead(0.0, gesture)
        guidance.torque(0.5, home, still, np.empty_like(home), np.empty_like(home))
