"""The simulated table with everything around it: rallies, camera and feeds, tick by tick.

The simulator node and the in-process rollouts both drive this class, so that the same commands give the
same trajectories with and without topics.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from msrd_ros.table_tennis.simulation.seen_ball import SeenBall, simulated_ns
from msrd_ros.table_tennis.simulation.teach_mode import HandGesture
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE


@dataclass(frozen=True)
class WorldConfig:
    """What the world is like.

    Attributes
    ----------
    rally
        Arm and scene.
    camera
        How well the ball is seen.
    seed
        Of the camera's noise.
    """

    rally: RallyConfig = field(default_factory=RallyConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    seed: int = 0


class Tick(NamedTuple):
    """What the robot's side learns once per tick: joints (N,) and the newest ball sample (3,), in SI."""

    time_ns: int
    joint_position: NDArray[np.float64]
    joint_velocity: NDArray[np.float64]
    joint_effort: NDArray[np.float64]
    ball_position: NDArray[np.float64]
    ball_stamp_ns: int
    label: StrategyLabel | None


class Result(NamedTuple):
    """One ball's outcome and the strategy that was wanted when it was launched."""

    label: StrategyLabel | None
    outcome: Outcome


def compile_ahead(config: RallyConfig) -> None:
    """Play a ball through a world of its own, so that nothing has to be compiled while others wait.

    The first time after an installation this takes some seconds; from then on the compiled code is kept. What
    teaching takes beside it is for `teach_mode.compile_ahead`.
    """
    rally = Rally(config)
    home = config.robot.home_rad
    rally.reset(home)
    rally.launch(Feeder().nominal(DEFAULT_SIDE))
    rally.command(home, np.full_like(home, 0.01), 0.02)
    rally.play_out()
    rally.close()


class World:
    """A robot at a table with feeder, camera and referee.

    Parameters
    ----------
    config
        What it is like.
    gui
        Show Bullet's window.
    """

    def __init__(self, config: WorldConfig, gui: bool = False) -> None:
        self.config = config
        self.rally = Rally(config.rally, gui=gui)
        self.strategy: StrategyLabel | None = None
        self.teaching = False
        self.balls = 0
        self.results: deque[Result] = deque()
        self._feeds: deque[tuple[Feed, int]] = deque()
        self._served: StrategyLabel | None = None
        self._label: StrategyLabel | None = None
        self._seen = SeenBall(config.camera, config.seed)
        self.rally.reset(config.rally.robot.home_rad)

    @property
    def time_ns(self) -> int:
        """Simulated time in whole nanoseconds."""
        return simulated_ns(self.rally.time)

    @property
    def feeds_waiting(self) -> int:
        """Balls that are to be launched."""
        return len(self._feeds)

    def close(self) -> None:
        """Let go of Bullet."""
        self.rally.close()

    def tick(self) -> Tick:
        """What is seen now."""
        rally = self.rally
        sample = self._seen.look(self.time_ns, rally.ball_in_play)
        return Tick(
            self.time_ns,
            rally.joint_position,
            rally.joint_velocity,
            rally.joint_effort,
            sample.position,
            sample.stamp_ns,
            self._label,
        )

    # -- what is done to the world -------------------------------------------------------------

    def feed(self, feed: Feed, not_before_ns: int = 0) -> None:
        """Launch a ball as soon as the arm rests and serves the strategy, not before a given time.

        While the arm is being taught, the ball is launched at the next tick.
        """
        self._feeds.append((feed, not_before_ns))

    def command(
        self,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        period_s: float,
        label: StrategyLabel | None,
    ) -> None:
        """Give the arm the state to reach in `period_s`, on behalf of a strategy."""
        self._served = label
        self.rally.command(position, velocity, period_s)

    def miss_commands(self) -> None:
        """Launch no ball until the arm is commanded again; without commands it comes to rest by itself."""
        self._served = None

    def lead_hand(self, gesture: HandGesture) -> None:
        """Say where the teacher's hand leads the paddle: a gesture that starts now, or one streamed point."""
        if len(gesture.times_s) > 1:
            self.rally.lead_gesture(gesture)
            return
        self.rally.lead_hand(
            gesture.positions[0], gesture.quaternions[0], gesture.velocities[0], gesture.angular_velocities[0]
        )

    def change_camera(self, config: CameraConfig) -> None:
        """See the ball better or worse from now on, at the same rate of frames."""
        self.config = replace(self.config, camera=config)
        self._seen.change_camera(config)

    def set_teaching(self, teaching: bool) -> None:
        """Switch between zero-g, led by the hand, and following commands."""
        self.teaching = teaching
        self._served = None
        self.rally.set_teach(teaching)

    def reset(self) -> None:
        """Bring the arm home at once; a ball in play is called off."""
        if self.rally.ball_in_play:
            self._finish(Outcome(self.rally.balls_launched - 1, False, MissReason.UNDECIDED))
        self._feeds.clear()
        self.rally.reset(self.config.rally.robot.home_rad)

    def advance(self, period_s: float) -> None:
        """Let time pass; a ball's outcome appears in `results` once its rally is over."""
        self._launch_if_ready()
        in_play = self.rally.ball_in_play
        self.rally.advance(period_s, self._watch)
        if in_play and self.rally.outcome is not None:
            self._finish(self.rally.outcome)

    # ------------------------------------------------------------------------------------------

    def _launch_if_ready(self) -> None:
        if not self._feeds or self.rally.ball_in_play:
            return
        feed, not_before_ns = self._feeds[0]
        shown = self._seen.wait_at(np.array(feed.position))
        # The ball is seen where it is launched from for one tick at least.
        if not shown or self.time_ns < not_before_ns:
            return
        if not self.teaching and not (self.rally.at_rest and self._served == self.strategy):
            return
        self._feeds.popleft()
        self._label = self.strategy
        self.balls += 1
        self._seen.launch(self.time_ns, self.balls)
        self.rally.launch(feed)

    def _finish(self, outcome: Outcome) -> None:
        self.results.append(Result(self._label, outcome))
        self._label = None

    def _watch(self, since_launch_s: float, ball: NDArray[np.float64]) -> None:
        """Show the camera where the ball is, once per simulation step."""
        self._seen.offer(since_launch_s, ball[:3])
