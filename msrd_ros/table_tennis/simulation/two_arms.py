"""Two arms at one table: a rally from the feed to the stroke that fails, in steps of one millisecond.

Each arm is simulated in the frame of its own end (`ball.ends`), in a Bullet client of its own with the table;
they cannot reach each other. The ball is one: it is kept in the frame of the arm whose stroke is next, judged
there by the same referee as a fed ball, and goes over to the other frame where it lands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.ends import End, between, turned
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.ball.referee import IN_PLAY, RETURNED, new_referees, outcome_of, struck_ball
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import NO_PADDLE, PADDLE_SIZE
from msrd_ros.table_tennis.simulation.bullet_scene import BulletScene, connect_bullet
from msrd_ros.table_tennis.simulation.rally import REACH_MARGIN_M
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.robot import STEP_S, SimulatedRobot

Array = NDArray[np.float64]

MOST_HITS = 1000
"""A rally is cut off after so many."""
_MOST_FINISHED = 64
_NO_PADDLES: Array = np.tile(NO_PADDLE, (2, 1))


@dataclass(frozen=True)
class Shot:
    """One arm's stroke in a rally.

    Attributes
    ----------
    end
        Whose.
    incoming
        The ball when it set out: fed, or just struck by the other arm. Shape (9,), in this end's frame.
    outcome
        What became of it, in this end's frame; times count from when the ball set out.
    """

    end: End
    incoming: Array
    outcome: Outcome


@dataclass(frozen=True)
class RallyRecord:
    """A rally that is over: its strokes in order, the last of which failed unless it was cut off."""

    shots: tuple[Shot, ...]

    @property
    def hits(self) -> int:
        """How long it was: strokes that brought the ball back onto the other half."""
        return sum(shot.outcome.returned for shot in self.shots)

    @property
    def end_reason(self) -> MissReason:
        """What ended it."""
        return self.shots[-1].outcome.miss_reason or MissReason.UNDECIDED


class TwoArms:
    """A table with an arm at each end, and one ball at a time.

    Parameters
    ----------
    config
        Scene and arm, the same at both ends.
    most_hits
        A rally is cut off after so many.

    Attributes
    ----------
    robots
        By end, each in its own frame.
    record
        The last rally, once it is over.
    finished
        Strokes that the referee has decided, for who takes them out.
    """

    def __init__(self, config: RallyConfig | None = None, most_hits: int = MOST_HITS) -> None:
        self.config = config = config or RallyConfig()
        require_apart(config)
        self._most_hits = most_hits
        self._clients = {end: _open_client(config) for end in End}
        self.robots: Mapping[End, SimulatedRobot] = {
            end: SimulatedRobot(client, config) for end, client in self._clients.items()
        }
        self._scene = config.scene.constants()
        self._longest_s = config.longest_s
        self._referee = new_referees(1)
        self._turn = End.NEAR
        self._state: Array = between(End.NEAR, np.array([1.5, 0.0, 1.06, 0, 0, 0, 0, 0, 0.0]))
        self._incoming = self._state
        self._set_out_s = 0.0
        self._steps = 0
        self._shots: list[Shot] = []
        self.finished: deque[Shot] = deque(maxlen=_MOST_FINISHED)
        self._paddle: Array = np.empty((2, PADDLE_SIZE))
        self._farthest_hit_x_m = float(config.robot.shoulder[0]) + config.robot.reach_m + REACH_MARGIN_M
        self.in_play = False
        self.launched = 0
        self.record: RallyRecord | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave Bullet. They cannot be used any more."""
        for client in self._clients.values():
            pybullet.disconnect(client)
        self._clients = {}

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self._steps * STEP_S

    @property
    def ball(self) -> Array:
        """Position (m), velocity (m/s) and spin (rad/s) of the ball in `world`, shape (9,)."""
        return between(self._turn, self._state).copy()

    @property
    def turn(self) -> End:
        """Whose stroke is under way or next."""
        return self._turn

    @property
    def hits(self) -> int:
        """Strokes of the rally under way that brought the ball back."""
        return len(self._shots)

    def launch(self, feed: Feed, end: End) -> None:
        """Feed a ball to an arm, in place of the one before; the feed is in the frame of its end.

        Raises
        ------
        UserError
            If a number of the feed is not finite.
        """
        state = feed.launched()
        self._turn, self._shots, self.record = end, [], None
        self._state = state
        self._await(state, 0)
        self.in_play = True
        self.launched += 1

    def advance(self, duration_s: float, watch: Callable[[float, Array], None] | None = None) -> None:
        """Let time pass.

        Parameters
        ----------
        duration_s
            Whole milliseconds, in seconds.
        watch
            Called after every millisecond in which the ball flew, with the time and its position in `world`,
            (3,).
        """
        for _ in range(round(duration_s / STEP_S)):
            in_play = self.in_play
            self._step()
            if in_play and watch is not None:
                watch(self.time, between(self._turn, self._state[:3]))

    # ------------------------------------------------------------------------------------------

    def _await(self, incoming: Array, bounces: int) -> None:
        """The ball now comes to the arm whose turn it is."""
        self._referee = new_referees(1)
        self._referee["own_bounces"] = bounces
        self._incoming = incoming.copy()
        if not bounces:
            self._set_out_s = self.time

    def _step(self) -> None:
        # Only the arm on whose half the ball is can meet it, and only there where that arm reaches.
        own = self._state[0] < 0.0
        end = self._turn if own else self._turn.other
        within_reach = self.in_play and -abs(self._state[0]) < self._farthest_hit_x_m
        paddle = self._paddle if within_reach else _NO_PADDLES
        if within_reach:
            self.robots[end].place_paddle(paddle[0])
        for arm in self.robots.values():
            arm.step(self.time)
        if within_reach:
            self.robots[end].place_paddle(paddle[1])
        if self.in_play:
            self._move_ball(paddle if own or not within_reach else turned(paddle), own)
        self._steps += 1

    def _move_ball(self, paddle: Array, own: bool) -> None:
        """One step of the ball and what the referee says to it; `own` half, of the arm whose turn it is."""
        referee, since_s = self._referee, self.time - self._set_out_s
        hits = int(referee["hits"][0])
        step_ball(self._state, referee, paddle[0], paddle[1], since_s, STEP_S, self._scene)
        verdict = int(referee["verdict"][0])
        if verdict == IN_PLAY:
            if since_s > self._longest_s:
                self._finish_shot()
                self._end()
        elif verdict == RETURNED:
            self._finish_shot()
            self._hand_over()
        elif hits and not own and referee["hits"][0] > 1:
            self._volley()
        else:
            self._finish_shot()
            self._end()

    def _finish_shot(self) -> None:
        outcome = outcome_of(self._referee, self.launched - 1)
        self._note(Shot(self._turn, self._incoming, outcome))

    def _note(self, shot: Shot) -> None:
        self._shots.append(shot)
        self.finished.append(shot)

    def _hand_over(self) -> None:
        """The ball has landed on the other half: it is the other arm's."""
        if len(self._shots) >= self._most_hits:
            self._end()
            return
        self._turn = self._turn.other
        self._state = turned(self._state)
        self._set_out_s += float(self._referee["hit_time"][0])
        self._await(turned(struck_ball(self._referee)[0]), 1)

    def _volley(self) -> None:
        """The other arm has touched the ball before it landed: its fault."""
        outcome = Outcome(self.launched - 1, True, MissReason.VOLLEY)
        self._note(Shot(self._turn.other, turned(struck_ball(self._referee)[0]), outcome))
        self._end()

    def _end(self) -> None:
        self.in_play = False
        self.record = RallyRecord(tuple(self._shots))


def require_apart(config: RallyConfig) -> float:
    """Distance in m that arms at both ends keep, whatever their joints do.

    Raises
    ------
    UserError
        If they could reach each other.
    """
    robot = config.robot
    apart_m = -2.0 * (float(robot.shoulder[0]) + robot.reach_m)
    if apart_m <= 0.0:
        raise UserError(
            f"{robot.name}: two of them at one table could reach each other (by {-apart_m:.2f} m); move "
            "`base` in robot.yaml away from the table"
        )
    return apart_m


def _open_client(config: RallyConfig) -> int:
    client = connect_bullet(False, config.scene.gravity_m_s2)
    BulletScene(client, config.scene, visible=False)
    return client
