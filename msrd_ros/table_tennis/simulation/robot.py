"""The robot as a whole: arm, driver, teaching hand and limits, one millisecond at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.dynamics import inverse_dynamics
from msrd_ros.robots.kinematics import paddle_pose, place_moving_paddle
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.rotations import quaternion_from_rotation
from msrd_ros.table_tennis.arm.driver import JointDriver
from msrd_ros.table_tennis.simulation.bullet_arm import BulletArm, LimitLog
from msrd_ros.table_tennis.simulation.gears import Gears
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.teach_mode import HandGesture, HandGuidance

Array = NDArray[np.float64]

STEP_S = 0.001
"""Step of Bullet, of the joints' driver and of the ball."""

_REST_POSITION_RAD = 2e-3
_REST_VELOCITY_RAD_S = 5e-3
"""An arm this near to its resting reference is held there by static friction."""


@dataclass(frozen=True)
class PaddlePose:
    """Where the blade is: centre (3,) in m, quaternion x, y, z, w and rotation (3, 3)."""

    position: Array
    quaternion: Array
    rotation: Array


class SimulatedRobot:
    """An arm in a Bullet client, with its driver and the hand that leads it.

    Parameters
    ----------
    client
        Of PyBullet; its time step is `STEP_S`.
    config
        Of the arm, its driver and the hand, and the table to be kept clear of.

    Attributes
    ----------
    limits
        What the joints did against their limits.
    """

    def __init__(self, client: int, config: RallyConfig) -> None:
        self._client = client
        self._robot = robot = config.robot
        self._arm = BulletArm(client, robot, config.arm)
        self._gears = Gears(robot, config.arm.backlash_rad) if config.arm.backlash_rad else None
        encoders = self._gears or self._arm
        self._measured, self._measured_velocity = encoders.position, encoders.velocity
        self._velocity_before: Array = np.zeros(robot.joint_count)
        self._driver = JointDriver(
            robot, STEP_S, config.scene.table, config.arm.limits_share, config.arm.dead_time_s
        )
        self._guidance = HandGuidance(robot, config.guidance, STEP_S)
        self._teaching = False
        self._led = False
        self._resting = True
        self._effort: Array = np.zeros(robot.joint_count)
        self._total_torque: Array = np.zeros(robot.joint_count)
        self.limits = LimitLog.of(robot)
        self.reset(robot.home_rad)

    @property
    def joint_position(self) -> Array:
        """Measured joint angles, shape (N,), rad."""
        return self._measured.copy()

    @property
    def joint_velocity(self) -> Array:
        """Measured joint rates (mean over the last millisecond), shape (N,), rad/s."""
        return self._measured_velocity.copy()

    @property
    def joint_effort(self) -> Array:
        """Torques of the motors in the last step, shape (N,), Nm."""
        if self._resting:
            return self._weight(self._arm.position)
        return self._effort.copy()

    @property
    def reference(self) -> JointReference:
        """Where the driver wants the joints to be now."""
        return self._driver.reference

    @property
    def at_rest(self) -> bool:
        """Whether the arm stands still, exactly where its reference rests."""
        return self._resting

    @property
    def teaching(self) -> bool:
        """Whether the arm may be led by the hand."""
        return self._teaching

    @property
    def paddle(self) -> PaddlePose:
        """Pose of the paddle."""
        position, rotation = paddle_pose(self._robot.model, self._arm.position)
        return PaddlePose(position, quaternion_from_rotation(rotation), rotation)

    def place_paddle(self, paddle: Array) -> None:
        """Write pose and motion of the paddle, shape (12,), as in `surfaces`."""
        place_moving_paddle(self._robot.model, self._arm.position, self._arm.velocity, paddle)

    def reset(self, joint_position: Array) -> None:
        """Put the arm at rest at `joint_position` (N,) in rad; a hand lets go.

        Raises
        ------
        UserError
            If an angle is not finite or out of its limits; the message names the joint.
        """
        angles = np.array(joint_position, dtype=np.float64).reshape(self._robot.joint_count)
        lower, upper = self._robot.limits.lower_rad, self._robot.limits.upper_rad
        inside = (angles >= lower) & (angles <= upper)
        if not inside.all():
            joint = int(np.argmin(inside))
            raise UserError(
                f"cannot place joint {self._robot.joint_names[joint]} at {angles[joint]} rad; stay within "
                f"{lower[joint]} to {upper[joint]}"
            )
        self.release_hand()
        self._led = False
        self._rest_at(angles)

    def command(self, position: Array, velocity: Array, period_s: float) -> None:
        """Lead the joints to a state; see `Rally.command`."""
        if self._teaching:
            return
        self._driver.command(position, velocity, period_s)
        self._resting = self._resting and self._driver.reference_rests

    def set_teach(self, teaching: bool) -> None:
        """Enter or leave teach mode; without a hand the arm comes to rest where it is."""
        if teaching == self._teaching:
            return
        self._teaching = teaching
        self.release_hand()
        self._led = False
        if not self._resting:
            self._driver.hold_at(self._measured, self._measured_velocity)

    def lead(self, time_s: float, gesture: HandGesture) -> None:
        """Let a hand lead the paddle through a gesture that starts at `time_s`.

        Raises
        ------
        UserError
            If the arm is not in teach mode.
        """
        if not self._teaching:
            raise UserError("the arm is not in teach mode; switch it on before leading the hand")
        self._guidance.lead(time_s, gesture)
        self._led = True
        self._resting = False

    def release_hand(self) -> None:
        """Let go of the paddle; the arm comes to rest and holds still."""
        self._guidance.release()

    def step(self, time_s: float) -> None:
        """Move the arm through one step from `time_s` on; one that rests is not touched."""
        if self._resting:
            return
        arm = self._arm
        if self._led and not self._guidance.holds_on(time_s):
            self._led = False
            self._driver.hold_at(self._measured, self._measured_velocity)
        if self._led:
            self._guidance.torque(time_s, arm.position, arm.velocity, self._effort, self._total_torque)
            arm.apply(self._total_torque)
        else:
            self._driver.torque(self._measured, self._measured_velocity, self._effort)
            arm.apply(self._effort)
        pybullet.stepSimulation(physicsClientId=self._client)
        arm.read()
        if self._gears is not None:
            self._gears.turn(arm.position, arm.velocity, self._planned_torque(), STEP_S)
        self.limits.note(arm.position, arm.velocity, self._effort)
        if not self._led and self._driver.reference_rests:
            self._rest_if_there(self._driver.reference.position)

    def _rest_if_there(self, goal: Array) -> None:
        slow = np.abs(self._arm.velocity).max() < _REST_VELOCITY_RAD_S
        if slow and np.abs(self._measured - goal).max() < _REST_POSITION_RAD:
            self._rest_at(goal)

    def _rest_at(self, position: Array) -> None:
        links = position
        if self._gears is not None:
            links = self._gears.rest(position, self._weight(position))
            self._velocity_before[:] = 0.0
        self._arm.place(links)
        self._driver.hold_at(position)
        self._resting = True

    def _planned_torque(self) -> Array:
        """Torques (N,) in Nm that the reference's motion takes: without the corrections of the driver.

        With these the gears would answer to what answers to the gears, in the same millisecond.
        """
        position, velocity = self._driver.reference
        change, self._velocity_before = velocity - self._velocity_before, velocity
        return inverse_dynamics(self._robot.model, position, velocity, change / STEP_S)

    def _weight(self, position: Array) -> Array:
        """Torques (N,) in Nm that hold the arm still."""
        still = np.zeros(self._robot.joint_count)
        return inverse_dynamics(self._robot.model, position, still, still)
