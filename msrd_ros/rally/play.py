"""Plays rallies in process, as two executors, two choosers and the match node do over topics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.limits import JointReference
from msrd_ros.table_tennis.ball.ends import End, between
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.two_arm_world import TwoArmWorld
from msrd_ros.table_tennis.simulation.two_arms import RallyRecord
from msrd_ros.table_tennis.simulation.world import Tick, WorldConfig
from msrd_ros.table_tennis.strokes.chooser import StrategyChooser
from msrd_ros.table_tennis.strokes.exchange import PolicyExchange
from msrd_ros.table_tennis.strokes.player import Phase, StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

Array = NDArray[np.float64]

CHOOSER_STREAM, FEED_STREAM = 0xC400, 0x4A11
LONGEST_WAIT_TICKS = 1000
"""Between two rallies: more than both arms need to get ready."""


class Unstruck(StrEnum):
    """Why an arm did not touch a ball that ended a rally."""

    NOT_READY = "not ready"
    """The arm was still on its way to a ready pose."""
    OUT_OF_REACH = "out of reach"
    """The ball came nowhere within the arm's reach."""
    SWUNG_PAST = "swung past"


class Track(NamedTuple):
    """A rally as it is filmed: T ticks of both arms' joints (T, N) in rad, and of the ball (T, 3) in m."""

    joints: dict[End, Array]
    ball: Array


@dataclass(frozen=True)
class PlayedRally:
    """One rally and what is known of it beside the referee's record.

    Attributes
    ----------
    record
        The referee's.
    fed_to
        Which arm had the first ball.
    strategies
        Of each stroke, in order.
    unstruck
        Why the last ball was not touched; None if it was.
    track
        For a film.
    """

    record: RallyRecord
    fed_to: End
    strategies: tuple[StrategyLabel | None, ...]
    unstruck: Unstruck | None
    track: Track

    @property
    def end_reason(self) -> str:
        """In words: what the referee says, and of a ball that was not touched why not."""
        reason = str(self.record.end_reason).replace("_", " ")
        return f"{reason}: {self.unstruck}" if self.unstruck else reason


class Player:
    """One arm's executor and chooser.

    Parameters
    ----------
    policies
        What it plays.
    joint_position
        Where its joints are, shape (N,), rad.
    rng
        Of its chooser.
    """

    def __init__(self, policies: StrokePolicies, joint_position: Array, rng: np.random.Generator) -> None:
        self._exchange = PolicyExchange(seed=0, ready_noise_rad=0.0)
        self._exchange.arriving = policies
        self._chooser = StrategyChooser(policies.robot, policies.facts, rng)
        self.stroke = StrokePlayer(policies.robot, joint_position, in_rally=True)

    @property
    def wanted(self) -> StrategyLabel:
        """The strategy that its chooser names."""
        return self._chooser.chosen

    def act(self, tick: Tick) -> tuple[JointReference, StrategyLabel | None]:
        """Answer a tick: the next command, and the strategy on whose behalf."""
        self._chooser.see(tick.time_ns, tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        self._exchange.wanted = self._chooser.chosen
        swapped = self._exchange.swap(self.stroke)
        self._exchange.prepare(self.stroke, swapped)
        reference = self.stroke.tick(tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        return reference, self._exchange.strategy


def play_rallies(
    policies: StrokePolicies,
    count: int,
    seed: int,
    spread: str = "standard",
    tell: Callable[[str], None] = lambda line: None,
) -> tuple[list[PlayedRally], int]:
    """Play rallies from random feeds: to either arm in turn, to the side on which it happens to wait.

    Parameters
    ----------
    policies
        Of both arms.
    count
        How many rallies.
    seed
        Of feeds, first strategies and camera.
    spread
        Of the feeds, a name of `SPREADS`.
    tell
        Hears of each rally.

    Returns
    -------
    played
        The rallies, in order.
    limits_exceeded
        How often a joint of either arm was seen over a limit.

    Raises
    ------
    UserError
        If the arms could reach each other, or do not get ready for a ball.
    """
    world = TwoArmWorld(WorldConfig(RallyConfig(robot=policies.robot), seed=seed))
    rng = np.random.default_rng((FEED_STREAM, seed))
    players = {
        end: Player(
            policies,
            world.arms.robots[end].joint_position,
            np.random.default_rng((CHOOSER_STREAM, seed, index)),
        )
        for index, end in enumerate(End)
    }
    played = []
    try:
        for number in range(count):
            end = list(End)[int(rng.integers(2))]
            played.append(_play_one(world, players, policies, end, spread, rng))
            tell(f"rally {number + 1}: {played[-1].record.hits} hits, ended by {played[-1].end_reason}")
        limits = [arm.limits.limits_exceeded for arm in world.arms.robots.values()]
    finally:
        world.close()
    return played, sum(limits)


def _play_one(
    world: TwoArmWorld,
    players: dict[End, Player],
    policies: StrokePolicies,
    fed_to: End,
    spread: str,
    rng: np.random.Generator,
) -> PlayedRally:
    strategies: list[StrategyLabel | None] = []
    rows: list[tuple[Array, Array, Array]] = []
    swings, fed, waited = False, False, 0
    while not world.results:
        world.look()
        in_play, turn, hits = world.arms.in_play, world.arms.turn, world.arms.hits
        if in_play:
            if hits == len(strategies):
                strategies.append(players[turn].wanted)
                swings = False
            swings |= players[turn].stroke.phase is Phase.STROKE
            strategies[-1] = players[turn].wanted
            near, far = (world.arms.robots[end].joint_position for end in End)
            rows.append((near, far, world.arms.ball[:3]))
        for end, player in players.items():
            reference, label = player.act(world.tick(end))
            world.strategies[end] = player.wanted
            world.command(end, reference.position, reference.velocity, CONTROL_PERIOD_S, label)
        if not fed and world.is_ready:
            # The side is that on which the arm waits, as of every feed in this package.
            side = policies.require(players[fed_to].wanted).side
            world.feed(Feeder().sample(side, SPREADS[spread], rng), fed_to)
            fed = True
        waited += not in_play
        if waited > LONGEST_WAIT_TICKS:
            raise UserError("the arms do not get ready for a ball; look at the policies' ready poses")
        world.advance(CONTROL_PERIOD_S)
    record = world.results.popleft()
    near, far, ball = (np.array(column) for column in zip(*rows, strict=True))
    last = record.shots[-1]
    unstruck = None
    if not last.outcome.struck:
        unstruck = _why_unstruck(policies, last.end, ball, swings)
    return PlayedRally(
        record, fed_to, tuple(strategies), unstruck, Track({End.NEAR: near, End.FAR: far}, ball)
    )


def _why_unstruck(policies: StrokePolicies, end: End, ball: Array, swings: bool) -> Unstruck:
    """Why an arm let the last ball of a rally pass; `ball` (T, 3) is that rally's, in `world`."""
    robot = policies.robot
    own = between(end, ball)
    # Back to where it last flew away from this arm's half: what came since is the ball in question.
    away = np.flatnonzero(own[:, 0] > 0.0)
    came = own[away[-1] :] if len(away) else own
    nearest_m = float(np.linalg.norm(came - robot.shoulder, axis=1).min())
    if nearest_m > robot.reach_m:
        return Unstruck.OUT_OF_REACH
    return Unstruck.SWUNG_PAST if swings else Unstruck.NOT_READY
