"""One table with robot, ball and referee: PyBullet moves the arm, the ball flies by `step_ball`.

The clock counts whole steps of one millisecond. An arm that has come to rest where its reference rests is
set exactly there and held by its brakes until it is commanded again, so a ball played from rest repeats
bit for bit whatever was played before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

import numpy as np
import pybullet
from numpy.typing import ArrayLike, NDArray

from msrd_ros.contract.outcome import Outcome
from msrd_ros.robots.limits import JointReference
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE, PADDLE_SIZE
from msrd_ros.table_tennis.simulation.bullet_arm import LimitLog
from msrd_ros.table_tennis.simulation.bullet_scene import BulletScene, connect_bullet
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture
from msrd_ros.table_tennis.simulation.played_ball import PlayedBall
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.robot import STEP_S, PaddlePose, SimulatedRobot

__all__ = ["Rally", "RallyConfig"]

Array = NDArray[np.float64]

REACH_MARGIN_M = 0.1
"""A ball so much farther away than the arm can reach is flown without looking at the paddle."""


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
        self.config = config = config or RallyConfig()
        self._client = connect_bullet(gui, config.scene.gravity_m_s2)
        self._scene = BulletScene(self._client, config.scene, visible=gui)
        self._robot = SimulatedRobot(self._client, config)
        self._ball = PlayedBall(config.scene, STEP_S, config.shortest_s, config.longest_s)
        self._farthest_hit_x_m = config.robot.shoulder[0] + config.robot.reach_m + REACH_MARGIN_M
        self._steps = 0
        self._paddle_before: Array = np.empty(PADDLE_SIZE)
        self._no_paddle: Array = NO_PADDLE.copy()  # one type, one compiled function
        self._paddle_after: Array = np.empty(PADDLE_SIZE)

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
    def limits(self) -> LimitLog:
        """What the joints did against their limits, so far."""
        return self._robot.limits

    @property
    def joint_position(self) -> Array:
        """Measured joint angles, shape (N,), rad."""
        return self._robot.joint_position

    @property
    def joint_velocity(self) -> Array:
        """Measured joint rates (mean over the last millisecond), shape (N,), rad/s."""
        return self._robot.joint_velocity

    @property
    def joint_effort(self) -> Array:
        """Torques of the motors in the last step, shape (N,), Nm."""
        return self._robot.joint_effort

    @property
    def reference(self) -> JointReference:
        """Where the driver wants the joints to be now."""
        return self._robot.reference

    @property
    def at_rest(self) -> bool:
        """Whether the arm stands still, exactly where its reference rests."""
        return self._robot.at_rest

    @property
    def paddle(self) -> PaddlePose:
        """Pose of the paddle."""
        return self._robot.paddle

    def reset(self, joint_position: Array) -> None:
        """Put the arm at rest at `joint_position` (N,) in rad; a ball in play is taken away undecided.

        Raises
        ------
        UserError
            If an angle is not finite or out of its limits; the message names the joint.
        """
        self._robot.reset(joint_position)
        self._ball.take_away()

    def command(self, position: Array, velocity: Array, period_s: float) -> None:
        """Lead the joints to a state, to be reached in `period_s`; limits hold whatever is asked for.

        When the command is used up and no other has come, the reference decelerates to a hold. While
        teaching, commands are ignored.

        Parameters
        ----------
        position, velocity
            Shape (N,), rad and rad/s.
        period_s
            Whole milliseconds, in seconds.

        Raises
        ------
        UserError
            If a number is not finite; the message names the joint. The arm then behaves as if no command
            had come.
        """
        self._robot.command(position, velocity, period_s)

    # -- teaching ----------------------------------------------------------------------------------------

    @property
    def teaching(self) -> bool:
        """Whether the arm may be led by the hand."""
        return self._robot.teaching

    def set_teach(self, teaching: bool) -> None:
        """Enter or leave teach mode; without a hand the arm comes to rest where it is."""
        self._robot.set_teach(teaching)

    def lead_hand(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Take the paddle by the hand and lead it to a pose, now; call again to lead it on.

        Between calls the hand goes on with the given velocities; when it has not been heard of for
        `GuidanceConfig.hand_timeout_s`, it has let go.

        Parameters
        ----------
        position, quaternion
            Of the paddle: blade's centre (3,) in m, and x, y, z, w.
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
        self._robot.lead(self.time, gesture)

    def release_hand(self) -> None:
        """Let go of the paddle; the arm comes to rest and holds still."""
        self._robot.release_hand()

    # -- the ball ----------------------------------------------------------------------------------------

    @property
    def ball(self) -> Array:
        """Position (m), velocity (m/s) and spin (rad/s) of the ball, shape (9,)."""
        return self._ball.state.copy()

    @property
    def ball_in_play(self) -> bool:
        """Whether a ball has been launched and its rally is not over."""
        return self._ball.in_play

    @property
    def ball_time(self) -> float:
        """Seconds since the last launch."""
        return self._ball.time_s

    @property
    def balls_launched(self) -> int:
        """How many balls there were; the last one's id is one less."""
        return self._ball.launched

    @property
    def outcome(self) -> Outcome | None:
        """What became of the ball launched last; None until its rally is over."""
        return self._ball.outcome

    def launch(self, feed: Feed) -> int:
        """Launch a ball now, in place of the one before, and return its id.

        Raises
        ------
        UserError
            If a number of the feed is not finite.
        """
        return self._ball.launch(feed)

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
            in_play = self._ball.in_play
            self._step()
            if in_play and watch is not None:
                watch(self._ball.time_s, self._ball.state)
        self._scene.show_ball(self._ball.state)

    def play_out(self) -> Outcome:
        """Let time pass until the rally under way is over.

        Raises
        ------
        ValueError
            If no ball is in play.
        """
        if not self._ball.in_play:
            raise ValueError("no ball is in play: launch one first")
        while self._ball.in_play:
            self._step()
        self._scene.show_ball(self._ball.state)
        assert self._ball.outcome is not None
        return self._ball.outcome

    def _step(self) -> None:
        ball = self._ball
        within_reach = ball.in_play and ball.state[0] < self._farthest_hit_x_m
        if within_reach:
            self._robot.place_paddle(self._paddle_before)
        self._robot.step(self.time)
        if within_reach:
            self._robot.place_paddle(self._paddle_after)
            ball.move(self._paddle_before, self._paddle_after)
        elif ball.in_play:
            ball.move(self._no_paddle, self._no_paddle)
        self._steps += 1
