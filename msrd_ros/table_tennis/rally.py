"""One table with robot, ball and referee: PyBullet moves the arm, the ball flies by `step_ball`.

The clock counts whole steps of one millisecond. An arm that has come to rest where its reference rests is
set exactly there and held by its brakes until it is commanded again, so a ball played from rest repeats
bit for bit whatever was played before.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
import pybullet
from numpy.typing import ArrayLike, NDArray

from msrd_ros.facts.errors import UserError
from msrd_ros.facts.motion_limits import JointReference
from msrd_ros.facts.outcome import Outcome
from msrd_ros.facts.sawyer import JOINT_COUNT, JOINT_NAMES, POSITION_LOWER_RAD, POSITION_UPPER_RAD
from msrd_ros.table_tennis.ball_step import step_ball
from msrd_ros.table_tennis.bullet_arm import ArmConfig, BulletArm, LimitLog
from msrd_ros.table_tennis.bullet_scene import BulletScene
from msrd_ros.table_tennis.dynamics import inverse_dynamics
from msrd_ros.table_tennis.feeder import Feed, Feeder
from msrd_ros.table_tennis.joint_driver import DriverGains, JointDriver
from msrd_ros.table_tennis.kinematics import paddle_pose, place_moving_paddle
from msrd_ros.table_tennis.referee import IN_PLAY, new_referees, outcome_of
from msrd_ros.table_tennis.rotations import quaternion_from_rotation
from msrd_ros.table_tennis.sawyer_description import BASE_POSITION
from msrd_ros.table_tennis.scene import Scene
from msrd_ros.table_tennis.surfaces import NO_PADDLE, PADDLE_SIZE
from msrd_ros.table_tennis.teaching import GuidanceConfig, HandGesture, HandGuidance

Array = NDArray[np.float64]

STEP_S = 0.001
"""Step of Bullet and of the ball."""
STEP_NS = 1_000_000

HOME_POSTURE: Array = np.array([0.0, 0.5, -1.2, 0.0, -0.5, 1.2, 0.0])
"""Joint angles in rad with the paddle before the middle of the table's end, clear of everything."""
HOME_POSTURE.setflags(write=False)

_FARTHEST_HIT_X_M = BASE_POSITION[0] + 1.6
"""No blade reaches a ball beyond: shoulder, stretched arm and paddle end 0.2 m before."""
_REST_POSITION_RAD = 2e-3
_REST_VELOCITY_RAD_S = 5e-3
"""An arm this near to its resting reference is held there by static friction."""


@dataclass(frozen=True)
class RallyConfig:
    """Everything about a `Rally` that can be chosen.

    Attributes
    ----------
    scene
        Table, net, ball and air.
    arm
        How the arm differs from the robot's model of itself.
    driver, guidance
        Gains of the joints' driver and of the teaching hand.
    shortest_s, longest_s
        A rally is over when the referee has decided and `shortest_s` have passed since the launch, or after
        `longest_s` undecided.
    """

    scene: Scene = field(default_factory=Scene)
    arm: ArmConfig = field(default_factory=ArmConfig)
    driver: DriverGains = field(default_factory=DriverGains)
    guidance: GuidanceConfig = field(default_factory=GuidanceConfig)
    shortest_s: float = 1.95
    longest_s: float = 4.0


@dataclass(frozen=True)
class PaddlePose:
    """Where the blade is: centre (3,) in m, quaternion x, y, z, w of `right_l6` and rotation (3, 3)."""

    position: Array
    quaternion: Array
    rotation: Array


class Rally:
    """PyBullet scene in which one ball at a time is played.

    Parameters
    ----------
    config
        Scene, arm and gains.
    gui
        Whether to open Bullet's window.
    """

    def __init__(self, config: RallyConfig | None = None, *, gui: bool = False) -> None:
        self.config = config or RallyConfig()
        self._client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self._client < 0:
            raise UserError("Bullet's window did not open; run with gui:=false where there is no display")
        pybullet.setGravity(0.0, 0.0, -self.config.scene.gravity_m_s2, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S, deterministicOverlappingPairs=1, physicsClientId=self._client
        )
        self._scene = BulletScene(self._client, self.config.scene, visible=gui)
        self._arm = BulletArm(self._client, self.config.arm)
        self._constants = self.config.scene.constants()
        self._driver = JointDriver(STEP_S, self.config.scene.table, self.config.driver)
        self._guidance = HandGuidance(self.config.guidance, STEP_S)
        self._teaching = False
        self._led = False
        self._resting = True
        self._steps = 0
        self._effort: Array = np.zeros(JOINT_COUNT)
        self._total_torque: Array = np.zeros(JOINT_COUNT)
        self.limits = LimitLog()
        self._ball: Array = Feed(Feeder().position_m, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)).state()
        self._referee = new_referees(1)
        self._ball_steps = 0
        self._shortest_steps = math.ceil(self.config.shortest_s / STEP_S - 1e-9)
        self._longest_steps = math.ceil(self.config.longest_s / STEP_S - 1e-9)
        self._ball_in_play = False
        self._balls_launched = 0
        self._outcome: Outcome | None = None
        self._paddle_before: Array = np.empty(PADDLE_SIZE)
        self._paddle_after: Array = np.empty(PADDLE_SIZE)
        self.reset(HOME_POSTURE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave Bullet. The rally cannot be used any more."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    # -- the robot ---------------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """Table, net, ball and air."""
        return self.config.scene

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self._steps * STEP_S

    @property
    def time_ns(self) -> int:
        """Nanoseconds since the start."""
        return self._steps * STEP_NS

    @property
    def joint_position(self) -> Array:
        """Measured joint angles, shape (7,), rad."""
        return self._arm.position.copy()

    @property
    def joint_velocity(self) -> Array:
        """Measured joint rates (mean over the last millisecond), shape (7,), rad/s."""
        return self._arm.velocity.copy()

    @property
    def joint_effort(self) -> Array:
        """Torques of the joints in the last step, shape (7,), Nm."""
        if self._resting:
            return inverse_dynamics(self._arm.position, np.zeros(JOINT_COUNT), np.zeros(JOINT_COUNT))
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
    def paddle(self) -> PaddlePose:
        """Pose of the paddle."""
        position, rotation = paddle_pose(self._arm.position)
        return PaddlePose(position, quaternion_from_rotation(rotation), rotation)

    def audit(self) -> dict[str, float]:
        """How near the joints came to their limits so far, and how often over them; see `LimitLog`."""
        return {
            "speed_limit_share": float(self.limits.speed_fraction.max()),
            "torque_limit_share": float(self.limits.torque_fraction.max()),
            "speed_exceeded": self.limits.speed_exceeded,
            "position_exceeded": self.limits.position_exceeded,
            "torque_exceeded": self.limits.torque_exceeded,
        }

    def reset(self, joint_position: Array) -> None:
        """Put the arm at rest at `joint_position` (7,) in rad; a ball in play is taken away undecided.

        Raises
        ------
        UserError
            If an angle is not finite or out of its limits; the message names the joint.
        """
        angles = np.array(joint_position, dtype=np.float64).reshape(JOINT_COUNT)
        inside = (angles >= POSITION_LOWER_RAD) & (angles <= POSITION_UPPER_RAD)
        if not inside.all():
            joint = int(np.argmin(inside))
            raise UserError(
                f"cannot place joint {JOINT_NAMES[joint]} at {angles[joint]} rad; stay within "
                f"{POSITION_LOWER_RAD[joint]} to {POSITION_UPPER_RAD[joint]}"
            )
        self._ball_in_play = False
        self._guidance.release()
        self._led = False
        self._rest_at(angles)

    def command(self, position: Array, velocity: Array, period_s: float) -> None:
        """Lead the joints to a state, to be reached in `period_s`; limits hold whatever is asked for.

        When the command is used up and no other has come, the reference decelerates to a hold. While
        teaching, commands are ignored.

        Parameters
        ----------
        position, velocity
            Shape (7,), rad and rad/s.
        period_s
            Whole milliseconds, in seconds.

        Raises
        ------
        UserError
            If a number is not finite; the message names the joint. The arm then behaves as if no command
            had come.
        """
        if self._teaching:
            return
        self._driver.command(position, velocity, period_s)
        self._resting = self._resting and self._driver.reference_rests

    # -- teaching ----------------------------------------------------------------------------------------

    @property
    def teaching(self) -> bool:
        """Whether the arm is in zero-g, to be led by the hand."""
        return self._teaching

    def set_teach(self, teaching: bool) -> None:
        """Enter or leave teach mode; without a hand the arm comes to rest where it is."""
        if teaching == self._teaching:
            return
        self._teaching = teaching
        self._guidance.release()
        self._led = False
        if not self._resting:
            self._driver.hold_at(self._arm.position, self._arm.velocity)

    def lead_hand(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Take the paddle by the hand and lead it to a pose, now; call again to lead it on.

        Between calls the hand goes on with the given velocities, and lets go when it has not been heard of
        for `GuidanceConfig.hand_timeout_s`.

        Parameters
        ----------
        position
            Of the blade's centre, shape (3,), m.
        quaternion
            x, y, z, w of `right_l6`.
        velocity, angular_velocity
            Of that pose, shape (3,), m/s and rad/s, in `world`.

        Raises
        ------
        UserError
            If the arm is not in teach mode, or a number is not finite.
        """
        self.lead_gesture(HandGesture.now(position, quaternion, velocity, angular_velocity))

    def lead_gesture(self, gesture: HandGesture) -> None:
        """Lead the paddle through a gesture that starts now; afterwards the hand keeps its last pose.

        Raises
        ------
        UserError
            If the arm is not in teach mode.
        """
        if not self._teaching:
            raise UserError("the arm is not in teach mode; switch it on before leading the hand")
        self._guidance.lead(self.time, gesture)
        self._led = True
        self._resting = False

    def release_hand(self) -> None:
        """Let go of the paddle; the arm comes to rest and holds still."""
        self._guidance.release()

    # -- the ball ----------------------------------------------------------------------------------------

    @property
    def ball(self) -> Array:
        """Position (m), velocity (m/s) and spin (rad/s) of the ball, shape (9,)."""
        return self._ball.copy()

    @property
    def ball_in_play(self) -> bool:
        """Whether a ball has been launched and its rally is not over."""
        return self._ball_in_play

    @property
    def ball_time(self) -> float:
        """Seconds since the last launch."""
        return self._ball_steps * STEP_S

    @property
    def balls_launched(self) -> int:
        """How many balls there were; the last one's id is one less."""
        return self._balls_launched

    @property
    def rally_over(self) -> bool:
        """Whether the last launched ball has an outcome."""
        return self._outcome is not None

    @property
    def outcome(self) -> Outcome | None:
        """What became of the ball launched last; None until its rally is over."""
        return self._outcome

    def launch(self, feed: Feed) -> int:
        """Launch a ball now, in place of the one before, and return its id.

        Raises
        ------
        UserError
            If a number of the feed is not finite.
        """
        state = feed.state()
        if not np.isfinite(state).all():
            raise UserError("feed holds a number that is not finite; give position, velocity and spin in SI")
        self._ball[:] = state
        self._referee = new_referees(1)
        self._ball_steps = 0
        self._ball_in_play = True
        self._outcome = None
        self._balls_launched += 1
        return self._balls_launched - 1

    def abort(self) -> Outcome:
        """End the rally under way as it stands."""
        self._ball_in_play = False
        self._outcome = outcome_of(self._referee, self._balls_launched - 1)
        return self._outcome

    def clear_ball(self) -> None:
        """Take the ball and its outcome away."""
        self._ball_in_play = False
        self._outcome = None

    # -- time --------------------------------------------------------------------------------------------

    def advance(self, duration_s: float, watch: Callable[[float, Array], None] | None = None) -> None:
        """Let time pass.

        Parameters
        ----------
        duration_s
            Whole milliseconds, in seconds.
        watch
            Called after every millisecond in which a ball flew, with the seconds since its launch and its
            state (9,): how a camera gets to see it.

        Raises
        ------
        ValueError
            If it is not a whole number of milliseconds.
        """
        steps = round(duration_s / STEP_S)
        if steps < 0 or abs(steps * STEP_S - duration_s) > 1e-9:
            raise ValueError(f"cannot advance by {duration_s} s: time goes in steps of {STEP_S} s")
        for _ in range(steps):
            in_play = self._ball_in_play
            self._step()
            if in_play and watch is not None:
                watch(self.ball_time, self._ball)
        self._scene.show_ball(self._ball)

    def play_out(self) -> Outcome:
        """Let time pass until the rally under way is over.

        Raises
        ------
        ValueError
            If no ball is in play.
        """
        if not self._ball_in_play:
            raise ValueError("no ball is in play: launch one first")
        while self._ball_in_play:
            self._step()
        self._scene.show_ball(self._ball)
        assert self._outcome is not None
        return self._outcome

    def _step(self) -> None:
        within_reach = self._ball_in_play and self._ball[0] < _FARTHEST_HIT_X_M
        if within_reach:
            place_moving_paddle(self._arm.position, self._arm.velocity, self._paddle_before)
        if not self._resting:
            self._move_arm()
        if self._ball_in_play:
            if within_reach:
                place_moving_paddle(self._arm.position, self._arm.velocity, self._paddle_after)
                self._move_ball(self._paddle_before, self._paddle_after)
            else:
                self._move_ball(NO_PADDLE, NO_PADDLE)
        self._steps += 1

    def _move_arm(self) -> None:
        arm = self._arm
        if self._led and not self._guidance.holds_on(self.time):
            self._led = False
            self._driver.hold_at(arm.position, arm.velocity)
        if self._led:
            self._guidance.torque(self.time, arm.position, arm.velocity, self._effort, self._total_torque)
            arm.apply(self._total_torque)
        else:
            self._driver.torque(arm.position, arm.velocity, self._effort)
            arm.apply(self._effort)
        pybullet.stepSimulation(physicsClientId=self._client)
        arm.read()
        self.limits.note(arm.position, arm.velocity, self._effort)
        if not self._led and self._driver.reference_rests:
            goal = self._driver.reference.position
            if (
                np.abs(arm.velocity).max() < _REST_VELOCITY_RAD_S
                and np.abs(arm.position - goal).max() < _REST_POSITION_RAD
            ):
                self._rest_at(goal)

    def _rest_at(self, position: Array) -> None:
        self._arm.place(position)
        self._driver.hold_at(position)
        self._resting = True

    def _move_ball(self, before: Array, after: Array) -> None:
        step_ball(self._ball, self._referee, before, after, self.ball_time, STEP_S, self._constants)
        self._ball_steps += 1
        if self._ball_steps >= self._shortest_steps:
            decided = self._referee["verdict"][0] != IN_PLAY
            if decided or self._ball_steps >= self._longest_steps:
                self.abort()
