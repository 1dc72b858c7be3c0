"""The ball that is being played, from its launch until its rally is over."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.outcome import Outcome
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.ball.referee import IN_PLAY, new_referees, outcome_of
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball

Array = NDArray[np.float64]


class PlayedBall:
    """One ball after the other, each with its own referee.

    Parameters
    ----------
    scene
        What it flies through and bounces on.
    step_s
        Of its motion.
    shortest_s, longest_s
        A rally is over when the referee has decided and `shortest_s` have passed since the launch, or after
        `longest_s` undecided.

    Attributes
    ----------
    state
        Position (m), velocity (m/s) and spin (rad/s), shape (9,); the last one's after its rally.
    in_play
        Whether a rally is under way.
    launched
        How many there were; the last one's id is one less.
    outcome
        What became of the last one; None until its rally is over.
    """

    def __init__(self, scene: Scene, step_s: float, shortest_s: float, longest_s: float) -> None:
        self._constants = scene.constants()
        self._step_s = step_s
        self._shortest_steps = math.ceil(shortest_s / step_s - 1e-9)
        self._longest_steps = math.ceil(longest_s / step_s - 1e-9)
        self._referee = new_referees(1)
        self._steps = 0
        self.state: Array = Feed(Feeder().position_m, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)).state()
        self.in_play = False
        self.launched = 0
        self.outcome: Outcome | None = None

    @property
    def time_s(self) -> float:
        """Seconds since the last launch."""
        return self._steps * self._step_s

    def launch(self, feed: Feed) -> int:
        """Launch a ball in place of the one before, and return its id.

        Raises
        ------
        UserError
            If a number of the feed is not finite.
        """
        state = feed.launched()
        self.state[:] = state
        self._referee = new_referees(1)
        self._steps = 0
        self.in_play = True
        self.outcome = None
        self.launched += 1
        return self.launched - 1

    def take_away(self) -> None:
        """End the rally without an outcome."""
        self.in_play = False

    def move(self, paddle_before: Array, paddle_after: Array) -> None:
        """Fly and bounce through one step, while the paddle moves from one state (12,) to the other."""
        time, step = self._steps * self._step_s, self._step_s
        step_ball(self.state, self._referee, paddle_before, paddle_after, time, step, self._constants)
        self._steps += 1
        if self._steps >= self._shortest_steps:
            decided = self._referee["verdict"][0] != IN_PLAY
            if decided or self._steps >= self._longest_steps:
                self.in_play = False
                self.outcome = outcome_of(self._referee, self.launched - 1)
