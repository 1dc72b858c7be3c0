"""Balls that judge a method: drawn from streams that no training touches, and played in Bullet."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from msrd_ros.cluster.workers import Workers
from msrd_ros.contract.episode import FIRST_ACTING_STEP, Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, STANDARD, Feed, Feeder, FeedSpread
from msrd_ros.table_tennis.simulation.world import Tick, World, WorldConfig
from msrd_ros.table_tennis.strategies.paper import PaperLabel
from msrd_ros.table_tennis.strokes.ball_filter import BallFilter
from msrd_ros.table_tennis.strokes.player import PolicyFunction
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies
from msrd_ros.table_tennis.strokes.rollouts import camera_sight, in_units, kept_world, play_in_world

REPLAY_GAIN = 6.0
"""Speed fraction per radian with which a replayed motion is followed: what corrective cloning uses, too."""


class Repertoire(Protocol):
    """What can be played: a stroke of a strategy, and the posture in which it begins."""

    def begin(
        self, label: StrategyLabel, rng: np.random.Generator
    ) -> tuple[PolicyFunction, NDArray[np.float64]]:
        """One stroke: from observation (N + 6,) to action (N,); and where the joints wait, (N,) in rad."""
        ...


@dataclass(frozen=True)
class LearnedStrokes:
    """The mean actions of learned policies."""

    policies: StrokePolicies

    def begin(
        self, label: StrategyLabel, rng: np.random.Generator
    ) -> tuple[PolicyFunction, NDArray[np.float64]]:
        """See `Repertoire`; draws nothing."""
        joints = self.policies.robot.joint_count
        unused = StrokeDraws(np.zeros(joints), np.zeros((0, joints)))
        return self.policies.play(label, unused), self.policies.require(label).ready_pose


@dataclass(frozen=True)
class ReplayedMotions:
    """The joint motion of a random demonstration each time, whatever the ball does.

    Attributes
    ----------
    episodes
        Demonstrations by strategy.
    """

    episodes: Mapping[StrategyLabel, Sequence[Episode]]

    def begin(
        self, label: StrategyLabel, rng: np.random.Generator
    ) -> tuple[PolicyFunction, NDArray[np.float64]]:
        """See `Repertoire`; draws a demonstration. Joints are followed, the ball is not looked at."""
        choice = self.episodes[label]
        episode = choice[int(rng.integers(len(choice)))]
        steps = iter(range(FIRST_ACTING_STEP, len(episode.actions)))

        def follow(observation: NDArray[np.float64]) -> NDArray[np.float64]:
            step = next(steps)
            astray = observation[: episode.robot.joint_count] - episode.joint_position[step]
            action: NDArray[np.float64] = episode.actions[step] - REPLAY_GAIN * astray
            return action

        return follow, episode.joint_position[0]


@dataclass(frozen=True)
class Conditions:
    """Under which balls are played.

    Attributes
    ----------
    world
        Arm, scene and camera.
    spread
        Of the feeds.
    ready_noise_rad
        Standard deviation of the start posture of each joint.
    filtered
        Whether the policies see the ball through a `BallFilter` rather than sample by sample.
    """

    world: WorldConfig = field(default_factory=WorldConfig)
    spread: FeedSpread = STANDARD
    ready_noise_rad: float = 0.03
    filtered: bool = False


class EvaluationBall(NamedTuple):
    """One ball: number, strategy, feed, offset of the start posture in standard deviations, seed."""

    number: int
    label: PaperLabel
    feed: Feed
    offset: NDArray[np.float64]
    seed: tuple[int, ...]


def evaluation_balls(
    labels: Sequence[PaperLabel],
    balls: int,
    seed: int,
    spread: FeedSpread,
    robot: Robot | None = None,
) -> list[EvaluationBall]:
    """`balls` balls for each strategy: the same for whoever plays them."""
    rng = np.random.default_rng((EVALUATION_STREAM, seed))
    joints = (robot or default_robot()).joint_count
    found: list[EvaluationBall] = []
    for label in labels:
        for _ in range(balls):
            key = (EVALUATION_STREAM, seed, len(found))
            offset = np.random.default_rng(key).standard_normal(joints)
            feed = Feeder().sample(label.side, spread, rng)
            found.append(EvaluationBall(len(found), label, feed, offset, (*key, 1)))
    return found


def play_ball(
    world: World, repertoire: Repertoire, ball: EvaluationBall, conditions: Conditions
) -> tuple[Outcome, Episode]:
    """Play one ball in a world of this process, as executor and simulator do over topics."""
    policy, pose = repertoire.begin(ball.label, np.random.default_rng(ball.seed))
    ready_pose = pose + conditions.ready_noise_rad * ball.offset
    sight = camera_sight
    if conditions.filtered:
        ball_filter = BallFilter(conditions.world.camera.noise_std_m)

        def sight(tick: Tick) -> tuple[NDArray[np.float64], int]:
            return ball_filter.see(tick.time_ns, tick.ball_stamp_ns, tick.ball_position)

    episode, outcome = play_in_world(world, ball.label, policy, ready_pose, ball.feed, ball.number, sight)
    return outcome, episode


class LimitsSeen(NamedTuple):
    """Milliseconds looked at and over a limit; largest speed and torque as fractions of their limits."""

    samples: int
    exceeded: int
    speed_fraction: float
    torque_fraction: float

    @classmethod
    def join(cls, parts: Sequence[LimitsSeen]) -> LimitsSeen:
        """All of them together."""
        return cls(
            sum(part.samples for part in parts),
            sum(part.exceeded for part in parts),
            max(part.speed_fraction for part in parts),
            max(part.torque_fraction for part in parts),
        )


class Played(NamedTuple):
    """Outcomes in the order of the balls, one film per strategy if wanted, and the joints' limits."""

    outcomes: list[Outcome]
    films: dict[StrategyLabel, Episode]
    limits: LimitsSeen


def _play(shared: tuple[bytes, Repertoire, Conditions], balls: Sequence[EvaluationBall]) -> Played:
    """One unit."""
    config, repertoire, conditions = shared
    world = kept_world(config)
    limits = world.rally.limits
    limits.clear()
    outcomes = []
    films: dict[StrategyLabel, Episode] = {}
    for ball in balls:
        outcome, episode = play_ball(world, repertoire, ball, conditions)
        outcomes.append(outcome)
        if outcome.returned and ball.label not in films:
            films[ball.label] = replace(episode, outcome=outcome)
    seen = LimitsSeen(
        limits.samples,
        limits.limits_exceeded,
        float(limits.speed_fraction.max()),
        float(limits.torque_fraction.max()),
    )
    return Played(outcomes, films, seen)


def play_balls(
    workers: Workers, repertoire: Repertoire, balls: Sequence[EvaluationBall], conditions: Conditions
) -> Played:
    """Let workers play balls; outcomes in their order."""
    shared = pickle.dumps(conditions.world), repertoire, conditions
    parts: list[Played] = workers.map(_play, [(part,) for part in in_units(balls)], shared)
    films = {label: film for part in reversed(parts) for label, film in part.films.items()}
    outcomes = [outcome for part in parts for outcome in part.outcomes]
    return Played(outcomes, films, LimitsSeen.join([part.limits for part in parts]))
