"""The referee: follows the touches of one ball and decides what became of it.

A state machine in compiled code over one `RefereeState`; both simulators use it through `step_ball`.
After the decision nothing changes any more.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.core.compiled import njit
from msrd_ros.table_tennis.ball.scene import SceneConstants
from msrd_ros.table_tennis.ball.surfaces import FLOOR, NET, PADDLE, TABLE


class RefereeState(Protocol):
    """What the referee knows of one ball; NaN is unknown."""

    verdict: int
    hits: int
    own_bounces: int
    net_touched: bool
    """After the hit."""
    hit_time: float
    decision_time: float
    landing_x: float
    landing_y: float
    hit_x: float
    hit_y: float
    hit_z: float
    """Where the ball was at the first hit."""
    velocity_x: float
    velocity_y: float
    velocity_z: float
    """Right after the first hit, as the spin."""
    spin_x: float
    spin_y: float
    spin_z: float


_KINDS = {"int": np.int64, "bool": np.bool_, "float": np.float64}
REFEREE = np.dtype([(name, _KINDS[kind]) for name, kind in RefereeState.__annotations__.items()])
"""`RefereeState` as a record of NumPy: compiled functions change it in place."""

_REASONS: tuple[MissReason, ...] = tuple(MissReason)
IN_PLAY = 0
RETURNED = 1
MISSED = 2 + _REASONS.index(MissReason.MISSED)
DOUBLE_BOUNCE = 2 + _REASONS.index(MissReason.DOUBLE_BOUNCE)
VOLLEY = 2 + _REASONS.index(MissReason.VOLLEY)
DOUBLE_HIT = 2 + _REASONS.index(MissReason.DOUBLE_HIT)
INTO_NET = 2 + _REASONS.index(MissReason.NET)
OWN_HALF = 2 + _REASONS.index(MissReason.OWN_HALF)
LONG = 2 + _REASONS.index(MissReason.LONG)
WIDE = 2 + _REASONS.index(MissReason.WIDE)
BAD_FEED = 2 + _REASONS.index(MissReason.BAD_FEED)
"""Values of `verdict`."""


def new_referees(*shape: int) -> NDArray[np.void]:
    """Referees of that many balls, none of which has been touched; an array of `REFEREE`."""
    referees = np.zeros(shape, dtype=REFEREE)
    for name, (kind, *_) in (REFEREE.fields or {}).items():
        if kind == np.float64:
            referees[name] = math.nan
    return referees


def miss_reason(verdict: int) -> MissReason | None:
    """What a value of `verdict` means; a ball still in play counts as undecided, None is a return."""
    if verdict == IN_PLAY:
        return MissReason.UNDECIDED
    return None if verdict == RETURNED else _REASONS[verdict - 2]


def struck_ball(referees: NDArray[np.void]) -> NDArray[np.float64]:
    """The balls right after the first hit, shape (..., 9), as referees (...) have seen them; NaN without."""
    names = [f"{what}_{axis}" for what in ("hit", "velocity", "spin") for axis in "xyz"]
    return np.stack([referees[name] for name in names], axis=-1)


def outcome_of(referee: NDArray[np.void], ball_id: int, launch_time: float = 0.0) -> Outcome:
    """Write down what a referee, array of shape (1,), has seen.

    `launch_time` is subtracted from its times, which are those given to `step_ball`.
    """
    state = referee[0]
    return Outcome(
        ball_id=ball_id,
        struck=bool(state["hits"] > 0),
        miss_reason=miss_reason(int(state["verdict"])),
        hit_time_s=float(state["hit_time"]) - launch_time,
        decision_time_s=float(state["decision_time"]) - launch_time,
        landing_x_m=float(state["landing_x"]),
        landing_y_m=float(state["landing_y"]),
        spin_x_rad_s=float(state["spin_x"]),
        spin_y_rad_s=float(state["spin_y"]),
        spin_z_rad_s=float(state["spin_z"]),
        velocity_x_m_s=float(state["velocity_x"]),
        velocity_y_m_s=float(state["velocity_y"]),
        velocity_z_m_s=float(state["velocity_z"]),
        net_touched=bool(state["net_touched"]),
    )


@njit(cache=True)
def decide(referee: RefereeState, verdict: int, time: float) -> None:
    """Write a verdict down, unless there is one or `IN_PLAY` is no verdict."""
    if referee.verdict == IN_PLAY and verdict != IN_PLAY:
        referee.verdict = verdict
        referee.decision_time = time


@njit(cache=True)
def judge_touch(referee: RefereeState, surface: int, ball: NDArray[np.float64], time: float) -> None:
    """Take note of one touch.

    Parameters
    ----------
    referee
        What it knows so far.
    surface
        One of the surfaces of `surfaces`.
    ball
        State right after the rebound, shape (9,).
    time
        Seconds.
    """
    if referee.verdict != IN_PLAY:
        return
    if surface == PADDLE:
        _judge_hit(referee, ball, time)
    elif surface == TABLE:
        _judge_bounce(referee, ball, time)
    elif surface == NET:
        if referee.hits > 0:
            referee.net_touched = True
    elif surface == FLOOR:
        if referee.hits > 0:
            verdict = INTO_NET if referee.net_touched else OWN_HALF
        else:
            verdict = MISSED if referee.own_bounces > 0 else BAD_FEED
        decide(referee, verdict, time)


@njit(cache=True)
def _judge_hit(referee: RefereeState, ball: NDArray[np.float64], time: float) -> None:
    referee.hits += 1
    verdict = DOUBLE_HIT
    if referee.hits == 1:
        referee.hit_time = time
        referee.hit_x, referee.hit_y, referee.hit_z = ball[0], ball[1], ball[2]
        referee.velocity_x, referee.velocity_y, referee.velocity_z = ball[3], ball[4], ball[5]
        referee.spin_x, referee.spin_y, referee.spin_z = ball[6], ball[7], ball[8]
        verdict = VOLLEY if referee.own_bounces == 0 else IN_PLAY
    decide(referee, verdict, time)


@njit(cache=True)
def _judge_bounce(referee: RefereeState, ball: NDArray[np.float64], time: float) -> None:
    far = ball[0] > 0.0
    verdict = IN_PLAY
    if referee.hits > 0:
        if far:
            referee.landing_x, referee.landing_y = ball[0], ball[1]
            verdict = RETURNED
        else:
            verdict = INTO_NET if referee.net_touched else OWN_HALF
    elif not far:
        referee.own_bounces += 1
        if referee.own_bounces > 1:
            verdict = DOUBLE_BOUNCE
    else:
        verdict = DOUBLE_BOUNCE if referee.own_bounces > 0 else BAD_FEED
    # One call: Numba compiles for every constant anew.
    decide(referee, verdict, time)


@njit(cache=True)
def judge_flight(
    referee: RefereeState, ball: NDArray[np.float64], time: float, scene: SceneConstants
) -> None:
    """Decide on a struck ball that sinks below the table's top: it cannot land on it any more."""
    if referee.verdict != IN_PLAY or referee.hits == 0 or ball[2] >= scene.table_top or ball[5] >= 0.0:
        return
    if referee.net_touched:
        verdict = INTO_NET
    elif ball[0] <= 0.0:
        verdict = OWN_HALF
    elif ball[0] - scene.table_half_length >= abs(ball[1]) - scene.table_half_width:
        verdict = LONG
    else:
        verdict = WIDE
    decide(referee, verdict, time)
