"""Fitting a law to pairs of events, and cross-validating it over players."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from msrd_ros.core.errors import UserError
from msrd_ros.studies.ball.law import BallLaw
from msrd_ros.studies.ball.pairs import Errors, Pairs, errors, predict
from msrd_ros.table_tennis.ball.flight import POSITION, SPIN

Array = NDArray[np.float64]

GRAVITY = "gravity_m_s2"
FLIGHT = ("drag_coefficient", "lift_slope", "lift_saturation", "velocity_lag_s")
REBOUND = ("friction",)
START = BallLaw(0.5, 1.0, 1.0, 0.9, 0.25, 0.0)
"""Where the search begins: round numbers."""

# What a residual of 1 stands for; farther off, residuals count by their size and not its square.
_POSITION_M = 0.03
_SPIN_RAD_S = 6.0
_SCALES = {
    "drag_coefficient": 0.1,
    "lift_slope": 1.0,
    "lift_saturation": 3.0,
    "velocity_lag_s": 0.01,
    "friction": 0.1,
    GRAVITY: 1.0,
}
_FEWEST_PAIRS = 50


class Fit(NamedTuple):
    """A law and the standard error of each of its numbers (jackknife over players)."""

    law: BallLaw
    spread: BallLaw


class CrossValidation(NamedTuple):
    """Errors of each pair under the law fitted to the other players, and these laws by player left out."""

    errors: Errors
    laws: dict[str, BallLaw]


def fit_law(pairs: Pairs, restitution: float) -> BallLaw:
    """The law that fits pairs best: first its flight to where they end, then its rebound's friction.

    Parameters
    ----------
    pairs
        That end in bounces.
    restitution
        Of the table, from elsewhere: recorded velocities after a bounce are late and would have it above 1.

    Raises
    ------
    UserError
        If there are too few pairs.
    """
    if len(pairs) < _FEWEST_PAIRS:
        raise UserError(f"{len(pairs)} pairs of events are too few to fit a law; at least {_FEWEST_PAIRS}")

    measured = np.isfinite(pairs.end).all(axis=1)

    def rebound(law: BallLaw) -> Array:
        # Only the spin: air changes it little until a late filter has found it.
        miss = (predict(pairs, law)[1] - pairs.end)[measured]
        return np.asarray(miss[:, SPIN].ravel() / _SPIN_RAD_S)

    return _fit(rebound, REBOUND, _fit_flight(pairs, FLIGHT, replace(START, restitution=restitution)))


def found_gravity(pairs: Pairs, law: BallLaw, late: bool) -> float:
    """Gravity in m/s^2 that the flights seem to have if it is left free with all else of a flight.

    Parameters
    ----------
    pairs
        That end in bounces.
    law
        Where the search begins.
    late
        Whether velocities are taken as late, by a lag that is free as well; or as recorded.
    """
    if late:
        return _fit_flight(pairs, (*FLIGHT, GRAVITY), law).gravity_m_s2
    names = tuple(name for name in FLIGHT if name != "velocity_lag_s")
    return _fit_flight(pairs, (*names, GRAVITY), replace(law, velocity_lag_s=0.0)).gravity_m_s2


def cross_validate(pairs: Pairs, restitution: float) -> CrossValidation:
    """Judge each player's pairs by the law fitted to all others.

    Raises
    ------
    UserError
        If there is but one player.
    """
    players = sorted(set(pairs.player.tolist()))
    if len(players) < 2:
        raise UserError(f"events of one player only ({players[0]}): a fit needs others to be judged on")
    held_out = [np.full(len(pairs), np.nan) for _ in fields(Errors)]
    laws = {}
    for player in players:
        rows = pairs.player == player
        laws[player] = fit_law(pairs.part(~rows), restitution)
        found = errors(pairs.part(rows), laws[player])
        for whole, part in zip(held_out, astuple(found), strict=True):
            whole[rows] = part
    return CrossValidation(Errors(*held_out), laws)


def fit_with_spread(pairs: Pairs, without: dict[str, BallLaw], restitution: float) -> Fit:
    """The law of all pairs, and its spread from the laws without one player each."""
    values = np.array([astuple(law) for law in without.values()])
    count = len(values)
    spread = np.sqrt((count - 1) / count * ((values - values.mean(axis=0)) ** 2).sum(axis=0))
    return Fit(fit_law(pairs, restitution), BallLaw(*spread.tolist()))


def _fit_flight(pairs: Pairs, names: tuple[str, ...], start: BallLaw) -> BallLaw:
    def misses(law: BallLaw) -> Array:
        return np.asarray((predict(pairs, law)[0] - pairs.end)[:, POSITION].ravel() / _POSITION_M)

    return _fit(misses, names, start)


def _fit(residuals: Callable[[BallLaw], Array], names: tuple[str, ...], start: BallLaw) -> BallLaw:
    scales = np.array([_SCALES[name] for name in names])

    def law_of(unknowns: Array) -> BallLaw:
        return replace(start, **dict(zip(names, (unknowns * scales).tolist(), strict=True)))

    first = np.array([getattr(start, name) for name in names]) / scales
    found = least_squares(
        lambda unknowns: residuals(law_of(unknowns)),
        first,
        bounds=(np.zeros(len(names)), np.full(len(names), np.inf)),
        loss="soft_l1",
        x_scale="jac",
    )
    return law_of(found.x)
