"""Names an arm's next strategy in a rally from where the ball comes.

All that it knows of the ball are the camera's positions. A ball on its way here is met where its path crosses
the plane of the hits; one on its way to the other arm is expected back on the side where that arm meets it,
because strokes go across the table. A strategy is named if the ball comes to its side, within the arm's
reach, and not before the arm is ready for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import FEED_SPEED_M_S, RESTING_SPEED_M_S, BallTracker
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import turned
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.player import RALLY_TRAVEL_SHARE
from msrd_ros.table_tennis.strokes.policies import StrokeFacts

Array = NDArray[np.float64]

HIT_PLANE_X_M = -1.57
"""About where strokes meet the ball, in the arm's own frame."""
MIDDLE_M = 0.1
"""A ball that comes nearer to the middle than this is for either side: the strategy stays."""
SWING_S = 0.45
"""From the ready pose to the hit."""
RETURN_S = 0.9
"""From the other arm's hit to ours, at least."""
_PERIOD_S = 0.01
_ROWS = 200
_TRAVEL_RAMP_S = 0.25
"""What starting and braking takes on that way."""
_RESTING_NS = 200_000_000


class Arrival(NamedTuple):
    """Where a ball is expected in the plane of the hits: in how many s, and its place (3,) in m."""

    wait_s: float
    place: Array


class StrategyChooser:
    """Watches the ball for one arm.

    Parameters
    ----------
    robot
        The arm, of N joints.
    facts
        Of the strategies that can be played.
    rng
        Draws the strategy with which the arm waits for the first ball of a rally.

    Attributes
    ----------
    chosen
        What is named now.
    """

    def __init__(
        self, robot: Robot, facts: Mapping[StrategyLabel, StrokeFacts], rng: np.random.Generator
    ) -> None:
        self._robot, self._facts, self._rng = robot, facts, rng
        self._scene = Scene().constants()
        self._ball = BallTracker()
        self._moved_ns: int | None = None
        self.chosen: StrategyLabel = self._draw()

    def see(self, time_ns: int, joint_position: Array, ball_position: Array, ball_stamp_ns: int) -> bool:
        """Take in a tick; whether another strategy is named now.

        Parameters
        ----------
        time_ns
            Present moment, of the clock of the stamps.
        joint_position
            As measured, shape (N,), rad.
        ball_position, ball_stamp_ns
            The camera's newest sample (3,) in m, and when it was taken.
        """
        before = self.chosen
        self._ball.add(ball_position, ball_stamp_ns)
        if np.abs(self._ball.velocity).max() > RESTING_SPEED_M_S:
            self._moved_ns = time_ns
            arrival = self._expect()
            if arrival is not None:
                self.chosen = self._choose(arrival, joint_position)
        elif self._moved_ns is not None and time_ns - self._moved_ns > _RESTING_NS:
            # The rally is over and another ball lies ready.
            self._moved_ns = None
            self.chosen = self._draw()
        return self.chosen != before

    def _draw(self) -> StrategyLabel:
        labels = list(self._facts)
        return labels[int(self._rng.integers(len(labels)))]

    def _expect(self) -> Arrival | None:
        """Where the ball that flies now is met by this arm; None if it flies nowhere."""
        velocity = self._ball.velocity
        state = np.concatenate([self._ball.position, velocity, np.zeros(3)])
        if velocity[0] < -FEED_SPEED_M_S:
            return self._crossing(state)
        if velocity[0] > FEED_SPEED_M_S:
            there = self._crossing(turned(state))
            return None if there is None else Arrival(there.wait_s + RETURN_S, there.place)
        return None

    def _crossing(self, state: Array) -> Arrival | None:
        """When and where a ball (9,) that comes towards x < 0 crosses the plane of the hits."""
        path = ball_path(state, _PERIOD_S, _ROWS, self._scene)
        passed = np.flatnonzero(path[:, 0] < HIT_PLANE_X_M)
        if not len(passed):
            return None
        return Arrival(float(passed[0]) * _PERIOD_S, path[passed[0], :3])

    def _choose(self, arrival: Arrival, joint_position: Array) -> StrategyLabel:
        """The strategy of the side that can be ready in time and is nearest; else the present one."""
        reach_m = float(np.linalg.norm(arrival.place - self._robot.shoulder))
        if abs(arrival.place[1]) < MIDDLE_M or reach_m > self._robot.reach_m:
            return self.chosen
        side = Side.at(float(arrival.place[1]))
        if self._facts[self.chosen].side is side:
            return self.chosen
        travels = {
            label: self._travel_s(joint_position, facts.ready_pose)
            for label, facts in self._facts.items()
            if facts.side is side
        }
        in_time = [label for label, travel_s in travels.items() if travel_s + SWING_S < arrival.wait_s]
        return min(in_time, key=lambda label: travels[label], default=self.chosen)

    def _travel_s(self, joint_position: Array, goal: Array) -> float:
        speed = RALLY_TRAVEL_SHARE * self._robot.limits.speed_rad_s
        return float((np.abs(goal - joint_position) / speed).max()) + _TRAVEL_RAMP_S
