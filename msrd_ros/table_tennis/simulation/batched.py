"""The batched simulator: hundreds of rallies side by side with an arm that follows its commands exactly.

Named for what it is: a kinematic arm, not Bullet's dynamics. Ball, touches and referee are the same
functions as in Bullet. Training may use it; every rate that is reported is played in Bullet.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import (
    ACTING_STEPS,
    CONTROL_PERIOD_S,
    FIRST_ACTING_STEP,
    HORIZON,
    action_names,
    observation_names,
    observe,
)
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feeder, FeedSpread
from msrd_ros.table_tennis.ball.flight import BALL_SIZE, POSITION
from msrd_ros.table_tennis.ball.referee import RETURNED, new_referees, struck_ball
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.batched_tick import advance_rallies, fly_on
from msrd_ros.table_tennis.strategies.table import Side

Array = NDArray[np.float64]

LONGEST_RALLY_S = 4.0
"""From the launch; a ball that is still in play then stays undecided."""


@dataclass(frozen=True)
class RallyPlan:
    """What one strategy's rallies have in common: the side that is fed, and where the arm waits.

    Parameters
    ----------
    side
        Forehand or backhand.
    ready_position
        Joint angles in rad, shape (N,).
    """

    side: Side
    ready_position: Array


@dataclass(frozen=True)
class RallyVariation:
    """How rallies differ from one another.

    Parameters
    ----------
    feed_spread
        Of the launches.
    ready_std_rad
        Standard deviation of each joint of the waiting arm about the ready pose.
    camera_noise_m
        Standard deviation of what is seen of the ball, each axis and tick.
    camera_latency_s
        What is seen is up to so old, uniformly, one delay for each rally; at most a control period.

    Raises
    ------
    UserError
        If the latency is longer than a control period.
    """

    feed_spread: FeedSpread = STANDARD
    ready_std_rad: float = 0.03
    camera_noise_m: float = 0.001
    camera_latency_s: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.camera_latency_s <= CONTROL_PERIOD_S:
            raise UserError(
                f"camera_latency_s is {self.camera_latency_s}; the batched simulator knows 0 to "
                f"{CONTROL_PERIOD_S}"
            )


class RallyResults(NamedTuple):
    """What became of the balls: arrays (S, K) for reports, never for learning; NaN is not happened.

    `verdict` has the values of `referee`, times count from the launch, `landing` is (S, K, 2) in m, `spin`
    (S, K, 3) in rad/s right after the hit, and `struck_ball` (S, K, 9) all of the ball then.
    """

    struck: NDArray[np.bool_]
    returned: NDArray[np.bool_]
    verdict: NDArray[np.int64]
    hit_time: Array
    landing: Array
    spin: Array
    struck_ball: Array


@dataclass(frozen=True)
class KinematicRalliesConfig:
    """Robot, scene, feeder, variation; how many threads share the work (results do not depend on it)."""

    scene: Scene = field(default_factory=Scene)
    feeder: Feeder = field(default_factory=Feeder)
    variation: RallyVariation = field(default_factory=RallyVariation)
    threads: int = min(2, os.cpu_count() or 1)
    robot: Robot = field(default_factory=default_robot)


class KinematicRallies:
    """S strategies times K rallies in step, one control tick at a time; a `BatchedEnvironment`.

    The first observation is that of tick `FIRST_ACTING_STEP`, when the ball's velocity is known from two
    samples; until then the arm waits. From there the policy acts for `acting_steps` ticks, then the arm
    brakes and rests while the ball flies on to `horizon`.

    Parameters
    ----------
    plans
        One for each strategy.
    config
        The rest.
    """

    horizon = HORIZON - FIRST_ACTING_STEP
    acting_steps = ACTING_STEPS

    def __init__(self, plans: Sequence[RallyPlan], config: KinematicRalliesConfig | None = None) -> None:
        self.plans = tuple(plans)
        self.config = config or KinematicRalliesConfig()
        robot = self.config.robot
        self._joints = robot.joint_count
        self.observation_names, self.action_names = observation_names(robot), action_names(robot)
        self._scene = self.config.scene.constants()
        self._pool = ThreadPoolExecutor(self.config.threads) if self.config.threads > 1 else None

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> Array:
        """Start new rallies, drawn from the variation; observations (S, K, N + 6).

        Raises
        ------
        UserError
            If `strategies` is not the number of plans.
        """
        if strategies != len(self.plans):
            raise UserError(
                f"batched simulator: {strategies} strategies asked for, {len(self.plans)} planned"
            )
        variation, limits = self.config.variation, self.config.robot.limits
        feeds = np.empty((strategies, episodes, BALL_SIZE))
        ready = np.empty((strategies, episodes, self._joints))
        for index, plan in enumerate(self.plans):
            feeds[index] = self.config.feeder.sample_states(plan.side, variation.feed_spread, episodes, rng)
            offset = variation.ready_std_rad * rng.standard_normal((episodes, self._joints))
            ready[index] = plan.ready_position + offset
        return self.start(feeds, np.clip(ready, limits.lowest_rad, limits.highest_rad), rng)

    def start(self, feeds: Array, ready_positions: Array, rng: np.random.Generator) -> Array:
        """Start given rallies; observations (S, K, N + 6).

        Parameters
        ----------
        feeds
            Launches, shape (S, K, 9).
        ready_positions
            Where the arms wait, rad, shape (S, K, N).
        rng
            Of the camera's noise, from now until the next start.
        """
        self._shape = feeds.shape[:2]
        count = self._shape[0] * self._shape[1]
        self._balls = np.array(feeds, dtype=np.float64).reshape(count, BALL_SIZE)
        self._positions = np.array(ready_positions, dtype=np.float64).reshape(count, self._joints)
        self._velocities = np.zeros_like(self._positions)
        self._referees = new_referees(count)
        self._rng = rng
        self._tick = 0
        latency_s = self.config.variation.camera_latency_s
        # Without latency nothing is drawn, so that seeds keep their rallies.
        self._lag = rng.uniform(0.0, latency_s, (count, 1)) / CONTROL_PERIOD_S if latency_s else 0.0
        self._shown = self._balls[:, POSITION].copy()
        self._seen = self._look()
        observation = np.empty(0)
        for _ in range(FIRST_ACTING_STEP):
            observation = self._advance(np.zeros((count, self._joints)))
        return observation

    def step(self, action: NDArray[np.floating]) -> Array:
        """Play one control tick; next observations (S, K, N + 6).

        Parameters
        ----------
        action
            Joint velocities as fractions of the limits, shape (S, K, N); beyond [-1, 1] they are clipped,
            after `acting_steps` they count as zero.

        Raises
        ------
        UserError
            If an action is not a number.
        """
        if np.isnan(action).any():
            raise UserError("batched simulator: an action is not a number; the policy's output is unusable")
        if self._tick >= FIRST_ACTING_STEP + self.acting_steps:
            action = np.zeros_like(action)
        return self._advance(np.asarray(action, dtype=np.float64).reshape(-1, self._joints))

    def play(self, actions: NDArray[np.floating]) -> Array:
        """Play actions (S, K, T, N) from a fresh start to the horizon; observations (S, K, H, N + 6)."""
        seen = []
        for step in range(self.horizon):
            rest = np.zeros((*self._shape, self._joints))
            seen.append(self.step(actions[:, :, step] if step < actions.shape[2] else rest))
        return np.stack(seen, axis=2)

    @property
    def joint_position(self) -> Array:
        """True joint angles, rad, shape (S, K, N)."""
        return self._positions.reshape(*self._shape, self._joints).copy()

    @property
    def joint_velocity(self) -> Array:
        """True joint rates, rad/s, shape (S, K, N)."""
        return self._velocities.reshape(*self._shape, self._joints).copy()

    @property
    def ball(self) -> Array:
        """True states of the balls, shape (S, K, 9)."""
        return self._balls.reshape(*self._shape, BALL_SIZE).copy()

    def results(self) -> RallyResults:
        """What became of the balls; those still in play fly on to their end, without changing the rallies."""
        referees = self._referees.copy()
        fly_on(self._balls.copy(), referees, self._tick * CONTROL_PERIOD_S, LONGEST_RALLY_S, self._scene)
        referees = referees.reshape(self._shape)
        return RallyResults(
            struck=referees["hits"] > 0,
            returned=referees["verdict"] == RETURNED,
            verdict=referees["verdict"],
            hit_time=referees["hit_time"],
            landing=np.stack([referees["landing_x"], referees["landing_y"]], axis=-1),
            spin=np.stack([referees["spin_x"], referees["spin_y"], referees["spin_z"]], axis=-1),
            struck_ball=struck_ball(referees),
        )

    def _advance(self, actions: Array) -> Array:
        bounds = np.linspace(0, len(actions), self.config.threads + 1).astype(int)
        time = self._tick * CONTROL_PERIOD_S
        if self._pool is None:
            self._advance_part(0, len(actions), actions, time)
        else:
            parts = [
                self._pool.submit(self._advance_part, first, last, actions, time)
                for first, last in pairwise(bounds)
            ]
            for part in parts:
                part.result()
        self._tick += 1
        before, self._seen = self._seen, self._look()
        velocity = (self._seen - before) / CONTROL_PERIOD_S
        return observe(self._positions, self._seen, velocity).reshape(*self._shape, -1)

    def _advance_part(self, first: int, last: int, actions: Array, time: float) -> None:
        part = slice(first, last)
        advance_rallies(
            self.config.robot.model,
            self._positions[part],
            self._velocities[part],
            actions[part],
            self._balls[part],
            self._referees[part],
            time,
            CONTROL_PERIOD_S,
            self._scene,
        )

    def _look(self) -> Array:
        noise = self._rng.standard_normal((len(self._balls), 3)) * self.config.variation.camera_noise_m
        before, self._shown = self._shown, self._balls[:, POSITION].copy()
        return self._shown + self._lag * (before - self._shown) + noise
