"""Two arms with everything around it: feeds and camera, tick by tick, as `World` is for one arm.

Each arm learns once per tick what an arm alone at the table learns: its joints, and where the camera saw the
ball, in the frame of its own end.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.table_tennis.ball.ends import End, between
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.simulation.seen_ball import EPOCH_NS, SeenBall, simulated_ns
from msrd_ros.table_tennis.simulation.two_arms import MOST_HITS, RallyRecord, TwoArms
from msrd_ros.table_tennis.simulation.world import Tick, WorldConfig

PAUSE_S = 0.5
"""Between two rallies at least: time to name other strategies in."""


class AddressedFeed(NamedTuple):
    """A ball to be launched: the feed in the frame of the end that it is for."""

    feed: Feed
    end: End


class TwoArmWorld:
    """Two arms at a table with feeder, camera and referee.

    Parameters
    ----------
    config
        What arms, table and camera are like.
    most_hits
        A rally is cut off after so many.

    Attributes
    ----------
    arms
        Arms, ball and referee.
    strategies
        What is wanted of each arm.
    results
        Rallies that are over.
    """

    def __init__(self, config: WorldConfig, most_hits: int = MOST_HITS) -> None:
        self.config = config
        self.arms = TwoArms(config.rally, most_hits)
        self.strategies: dict[End, StrategyLabel | None] = dict.fromkeys(End)
        self.results: deque[RallyRecord] = deque()
        self._served: dict[End, StrategyLabel | None] = dict.fromkeys(End)
        self._feeds: deque[AddressedFeed] = deque()
        self._seen = SeenBall(config.camera, config.seed)
        self._sample = self._seen.look(self.time_ns, in_play=False)
        self._idle_since_s = 0.0

    @property
    def time_ns(self) -> int:
        """Simulated time in whole nanoseconds."""
        return simulated_ns(self.arms.time)

    @property
    def feeds_waiting(self) -> int:
        """Balls that are to be launched."""
        return len(self._feeds)

    @property
    def is_ready(self) -> bool:
        """Whether a rally may begin: both arms have had a pause, rest, and serve the strategies wanted."""
        paused_s = self.arms.time - self._idle_since_s
        return not self.arms.in_play and paused_s > PAUSE_S and self._arms_are_ready

    @property
    def _arms_are_ready(self) -> bool:
        return all(self.arms.robots[end].at_rest and self._served[end] == self.strategies[end] for end in End)

    def close(self) -> None:
        """Let go of Bullet."""
        self.arms.close()

    def look(self) -> None:
        """Take in the camera's newest frame; once a tick, before `tick` of both ends."""
        self._sample = self._seen.look(self.time_ns, self.arms.in_play)

    def tick(self, end: End) -> Tick:
        """What an arm learns now, in the frame of its end."""
        arm = self.arms.robots[end]
        return Tick(
            self.time_ns,
            arm.joint_position,
            arm.joint_velocity,
            arm.joint_effort,
            between(end, self._sample.position),
            self._sample.stamp_ns,
            self._served[end] if self.arms.in_play else None,
        )

    def feed(self, feed: Feed, end: End) -> None:
        """Launch a ball to an arm as soon as both arms rest and serve the strategies wanted of them."""
        self._feeds.append(AddressedFeed(feed, end))

    def command(
        self,
        end: End,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        period_s: float,
        label: StrategyLabel | None,
    ) -> None:
        """Give an arm the state to reach in `period_s`, on behalf of a strategy."""
        self._served[end] = label
        self.arms.robots[end].command(position, velocity, period_s)

    def advance(self, period_s: float) -> None:
        """Let time pass; a rally appears in `results` once it is over."""
        self._launch_if_ready()
        in_play = self.arms.in_play
        self.arms.advance(period_s, self._watch)
        if in_play and self.arms.record is not None:
            self.results.append(self.arms.record)
            self._idle_since_s = self.arms.time

    def _launch_if_ready(self) -> None:
        if not self._feeds or self.arms.in_play:
            return
        feed, end = self._feeds[0]
        shown = self._seen.wait_at(between(end, np.array(feed.position)))
        # The ball is seen where it is launched from for one tick at least.
        if not shown or not self._arms_are_ready:
            return
        self._feeds.popleft()
        self._seen.launch(self.time_ns, self.arms.launched + 1)
        self.arms.launch(feed, end)

    def _watch(self, time_s: float, ball: NDArray[np.float64]) -> None:
        """Show the camera where the ball is, once per simulation step."""
        self._seen.offer(time_s - (self._seen.launch_ns - EPOCH_NS) / NANOSECONDS, ball)
