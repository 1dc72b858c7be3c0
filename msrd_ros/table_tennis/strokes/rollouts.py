"""Rollouts of strokes one by one: what is played, and workers that play it in Bullet.

A batch of strokes is fully described by a seed and the number of balls played before it, so that Bullet
workers and rollouts over topics give the same trajectories.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from msrd_ros.cluster.workers import Workers
from msrd_ros.contract.episode import (
    ACTING_STEPS,
    CONTROL_PERIOD_S,
    FIRST_ACTING_STEP,
    HORIZON,
    Episode,
    action_names,
    observation_names,
)
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feed, Feeder
from msrd_ros.table_tennis.simulation.world import Tick, World, WorldConfig
from msrd_ros.table_tennis.strokes.player import PolicyFunction, StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies

T = TypeVar("T")

FEED_STREAM = 0xF00D

BALLS_PER_UNIT = 12
"""About half a second of Bullet: long beside what handing out a unit takes, and short beside an iteration."""

PolicySource = Callable[[], StrokePolicies]
"""Gives the trainer's present policies with their ready poses."""


def in_units(balls: Sequence[T]) -> list[Sequence[T]]:
    """Balls in the parts in which workers play them; these do not depend on how many workers there are."""
    return [balls[first : first + BALLS_PER_UNIT] for first in range(0, len(balls), BALLS_PER_UNIT)]


class Stroke(NamedTuple):
    """One stroke to play: which, against which ball, and its number within the batch."""

    label: StrategyLabel
    feed: Feed
    number: int


@dataclass(frozen=True)
class StrokeBatch:
    """Strokes to play with one version of the policies.

    Attributes
    ----------
    strokes
        In the order in which they are played over topics.
    policies
        With the exploration seed of this batch.
    balls_before
        Balls that the simulator had launched before; its camera's noise follows from that.
    """

    strokes: tuple[Stroke, ...]
    policies: StrokePolicies
    balls_before: int

    @classmethod
    def draw(
        cls,
        policies: StrokePolicies,
        episodes: int,
        spread: str,
        ready_noise_rad: float,
        balls_before: int,
        rng: np.random.Generator,
    ) -> StrokeBatch:
        """`episodes` strokes of every strategy, all of one strategy in a row."""
        seed = int(rng.integers(2**31))
        feeder = Feeder()
        strokes: list[Stroke] = []
        for label, facts in policies.facts.items():
            for _ in range(episodes):
                index = len(strokes)
                feed = feeder.sample(
                    facts.side, SPREADS[spread], np.random.default_rng((FEED_STREAM, seed, index))
                )
                strokes.append(Stroke(label, feed, index))
        exploring = replace(policies, exploration_seed=seed, ready_noise_rad=ready_noise_rad)
        return cls(tuple(strokes), exploring, balls_before)

    def rollouts(self, episodes: Sequence[Episode], policies: Policies) -> Rollouts:
        """What was played, as learning wants it: the strokes' actions follow from their draws.

        Parameters
        ----------
        episodes
            One per stroke, in order.
        policies
            The trainer's own, for the log-probabilities.
        """
        labels = self.policies.labels
        count = len(self.strokes) // len(labels)
        shape = (len(labels), count)
        robot = self.policies.robot
        steps = HORIZON + 1 - FIRST_ACTING_STEP
        observations = np.empty((*shape, steps, len(observation_names(robot))), np.float32)
        actions = np.empty((*shape, ACTING_STEPS, len(action_names(robot))), np.float32)
        for stroke, episode in zip(self.strokes, episodes, strict=True):
            row, column = divmod(stroke.number, count)
            seen = episode.observations[FIRST_ACTING_STEP:]
            seed = self.policies.exploration_seed
            assert seed is not None
            act = self.policies.play(stroke.label, StrokeDraws.of(seed, stroke.number, robot.joint_count))
            observations[row, column] = seen
            actions[row, column] = [act(observation) for observation in seen[:ACTING_STEPS]]
        log_probs = policies.rollout_log_probs(observations[:, :, :ACTING_STEPS], actions)
        return Rollouts(observations, actions, log_probs)


def play_stroke(
    world: World,
    policies: StrokePolicies,
    stroke: Stroke,
    ball_number: int,
    ready_noise_rad: float,
    seed: int,
) -> tuple[Episode, Outcome]:
    """Play one stroke in a world of this process, as executor and simulator do over topics.

    Parameters
    ----------
    ball_number
        How many balls the simulator would have launched before this one.
    ready_noise_rad, seed
        Of the start posture and, if the policies explore, of the actions.
    """
    robot = policies.robot
    draws = StrokeDraws.of(seed, stroke.number, robot.joint_count)
    ready_pose = policies.require(stroke.label).ready_pose + ready_noise_rad * draws.ready
    policy = policies.play(stroke.label, draws)
    return play_in_world(world, stroke.label, policy, ready_pose, stroke.feed, ball_number)


def camera_sight(tick: Tick) -> tuple[NDArray[np.float64], int]:
    """The ball as the camera shows it: position (3,) in m, and when it was there in nanoseconds."""
    return tick.ball_position, tick.ball_stamp_ns


def play_in_world(
    world: World,
    label: StrategyLabel,
    policy: PolicyFunction,
    ready_pose: NDArray[np.float64],
    feed: Feed,
    ball_number: int,
    sight: Callable[[Tick], tuple[NDArray[np.float64], int]] = camera_sight,
) -> tuple[Episode, Outcome]:
    """Play one ball from rest in a world of this process, as executor and simulator do over topics.

    Parameters
    ----------
    policy
        From observation (N + 6,) to action (N,).
    ready_pose
        Where the joints wait, shape (N,), rad; drawn into the joints' limits.
    ball_number
        How many balls the simulator would have launched before this one.
    sight
        How the policy sees the ball; the episode holds what the camera shows.
    """
    robot = world.config.rally.robot
    ready_pose = np.clip(ready_pose, robot.limits.lowest_rad, robot.limits.highest_rad)
    world.rally.reset(ready_pose)
    world.balls = ball_number
    world.strategy = label
    player = StrokePlayer(robot, ready_pose)
    player.prepare(policy, ready_pose)
    assembler = EpisodeAssembler(label, source="Bullet", robot=robot)
    world.feed(feed)
    while not world.results:
        tick = world.tick()
        assembler.add_joints(tick.time_ns, tick.joint_position, tick.joint_velocity)
        assembler.add_ball(tick.ball_stamp_ns, tick.ball_position)
        reference = player.tick(tick.joint_position, *sight(tick))
        world.command(reference.position, reference.velocity, CONTROL_PERIOD_S, label)
        world.advance(CONTROL_PERIOD_S)
    return assembler.assemble(), world.results.popleft().outcome


_kept: tuple[bytes, World] | None = None


def kept_world(config: bytes) -> World:
    """The world of this process for a pickled `WorldConfig`, kept for as long as it is the same one's.

    What is played in it does not depend on what was played before.
    """
    global _kept
    if _kept is None or _kept[0] != config:
        if _kept is not None:
            _kept[1].close()
        _kept = config, World(pickle.loads(config))
    return _kept[1]


def _play(shared: tuple[bytes, bytes, int], strokes: Sequence[Stroke]) -> list[tuple[Episode, Outcome]]:
    config, data, balls_before = shared
    world = kept_world(config)
    policies = StrokePolicies.from_bytes(data, "rollout policies", world.config.rally.robot)
    seed, noise_rad = policies.exploration_seed, policies.ready_noise_rad
    assert seed is not None
    return [
        play_stroke(world, policies, stroke, balls_before + stroke.number, noise_rad, seed)
        for stroke in strokes
    ]


class BulletPlayers:
    """Workers that play in Bullet worlds of their own.

    Parameters
    ----------
    workers
        Who plays.
    config
        Of the worlds.
    """

    def __init__(self, workers: Workers, config: WorldConfig) -> None:
        self._workers = workers
        self._config = pickle.dumps(config)

    def play(self, batch: StrokeBatch) -> list[tuple[Episode, Outcome]]:
        """Play a batch; episodes and outcomes in its order."""
        shared = self._config, batch.policies.to_bytes(), batch.balls_before
        units = [(part,) for part in in_units(batch.strokes)]
        return [result for results in self._workers.map(_play, units, shared) for result in results]


class BulletCollector:
    """Rollouts in Bullet instead of the batched simulator.

    Parameters
    ----------
    players
        The workers.
    source
        Gives the present policies.
    spread, ready_noise_rad
        Of the feeds and of the start posture.
    """

    def __init__(
        self, players: BulletPlayers, source: PolicySource, spread: str, ready_noise_rad: float
    ) -> None:
        self._players, self._source = players, source
        self._spread, self._ready_noise_rad = spread, ready_noise_rad
        self._balls = 0

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        """Play `episodes` strokes of every strategy."""
        batch = StrokeBatch.draw(
            self._source(), episodes, self._spread, self._ready_noise_rad, self._balls, rng
        )
        self._balls += len(batch.strokes)
        played = self._players.play(batch)
        return batch.rollouts([episode for episode, _ in played], policies)
