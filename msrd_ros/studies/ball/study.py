"""The study: a law of flight and rebound judged on recordings, and fitted to them with players held apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.studies.ball.fit import CrossValidation, cross_validate, fit_with_spread, found_gravity
from msrd_ros.studies.ball.law import LAW, OLD_LAW, BallLaw
from msrd_ros.studies.ball.noise import noise_floor
from msrd_ros.studies.ball.pairs import Errors, Pairs, errors, pairs_to
from msrd_ros.studies.ball.recordings import WHERE_TO_GET, SpinFlight, read_events, read_flights
from msrd_ros.studies.ball.spin_flights import bounces, end_errors, frames

Array = NDArray[np.float64]

SPINS_RAD_S = {
    "below_100": (0.0, 100.0),
    "100_to_300": (100.0, 300.0),
    "above_300": (300.0, np.inf),
}
"""By name: the first not included, the last included, as spins at the start of a flight."""


def run_study(data: Path | None, fit: bool, tick: Callable[[str], None]) -> dict[str, Any]:
    """Judge the package's law, or one fitted to the recordings, on a folder of recordings.

    Parameters
    ----------
    data
        The folder; its form is in `recordings`.
    fit
        Fit the law; then each player's pairs are judged by the law fitted to all other players.
    tick
        Told what is under way.

    Returns
    -------
    dict
        ``flight``, ``bounce`` and ``spindoe`` as far as there are recordings for them, each error as median,
        90th percentile and count; ``law``, and what was found out about the recordings.

    Raises
    ------
    UserError
        If there is no such folder, nothing to judge in it or something malformed.
    """
    if data is None:
        raise UserError(f"ball needs recordings: --data FOLDER. They are not ours to ship: {WHERE_TO_GET}")
    if not data.is_dir():
        raise UserError(f"--data {data}: no such folder. {WHERE_TO_GET}")
    tick("reading")
    events, flights = read_events(data), read_flights(data)
    if events is None and flights is None:
        raise UserError(f"--data {data}: neither match_events.csv nor flights in it. {WHERE_TO_GET}")
    if fit and events is None:
        raise UserError(f"--data {data}: --fit needs match_events.csv. {WHERE_TO_GET}")
    law, metrics = LAW, {}
    if events is not None:
        pairs = pairs_to(events, "bounce")
        if not len(pairs):
            raise UserError("match_events.csv: no bounce that follows a shot or bounce within 1.2 s")
        if fit:
            tick("fitting the law, once for each player left out")
            # Not fitted: of these recordings neither has a restitution that a table has.
            held_out = cross_validate(pairs, LAW.restitution)
            fitted = fit_with_spread(pairs, held_out.laws, LAW.restitution)
            law = fitted.law
            metrics["spread"] = fitted.spread.numbers()
            metrics["gravity_left_free_m_s2"] = {
                "velocities_as_recorded": found_gravity(pairs, law, late=False),
                "velocities_taken_as_late": found_gravity(pairs, law, late=True),
            }
        else:
            held_out = CrossValidation(errors(pairs, law), {})
        metrics |= _judge_events(pairs, pairs_to(events, "shot"), law, held_out)
    if flights is not None:
        tick("foretelling flights from their first half")
        metrics |= _judge_flights(flights, law)
    return {"law": law.numbers(), "fitted": fit, **metrics}


def summary(values: Array) -> dict[str, float | int]:
    """Median, 90th percentile and count of what is a number."""
    known = values[np.isfinite(values)]
    if not known.size:
        return {"median": float("nan"), "p90": float("nan"), "count": 0}
    return {
        "median": float(np.median(known)),
        "p90": float(np.percentile(known, 90)),
        "count": int(known.size),
    }


def _judge_events(pairs: Pairs, to_shots: Pairs, law: BallLaw, judged: CrossValidation) -> dict[str, Any]:
    found = judged.errors
    old, plain = errors(pairs, OLD_LAW), errors(pairs, replace(law, velocity_lag_s=0.0))
    old_lagging = errors(pairs, replace(OLD_LAW, velocity_lag_s=law.velocity_lag_s))
    metrics: dict[str, Any] = {
        "flight": {
            **_positions(pairs, found),
            "by_player": {
                player: summary(found.position[pairs.player == player])
                for player in sorted(set(pairs.player.tolist()))
            },
            "old_law": _positions(pairs, old),
            "old_law_with_lag": _positions(pairs, old_lagging),
            "states_as_recorded": _positions(pairs, plain),
        },
        "bounce": {
            **_rebounds(found),
            "old_law": _rebounds(old),
            "old_law_with_lag": _rebounds(old_lagging),
            "states_as_recorded": _rebounds(plain),
        },
    }
    if judged.laws:
        metrics["laws_without"] = {player: one.numbers() for player, one in judged.laws.items()}
    # What comes next after a bounce and is no bounce was fitted to by nobody.
    metrics["flight"]["to_next_shot"] = {
        "position_error_m": summary(errors(to_shots, law).position),
        "old_law": summary(errors(to_shots, OLD_LAW).position),
    }
    floor = noise_floor(pairs, law)
    if floor is not None:
        metrics["noise"] = {
            **floor._asdict(),
            "flight_position_error_m": summary(floor.positions_of(pairs)),
            "bounce_velocity_error_m_s": summary(floor.velocities()),
            "bounce_spin_error_rad_s": summary(floor.spins()),
        }
    return metrics


def _positions(pairs: Pairs, found: Errors) -> dict[str, Any]:
    spin = pairs.spin_rad_s
    parts = {
        name: summary(found.position[(spin > low) & (spin <= high)])
        for name, (low, high) in SPINS_RAD_S.items()
    }
    return {"position_error_m": summary(found.position), **parts}


def _rebounds(found: Errors) -> dict[str, Any]:
    return {"velocity_error_m_s": summary(found.velocity), "spin_error_rad_s": summary(found.spin)}


def _judge_flights(flights: list[SpinFlight], law: BallLaw) -> dict[str, Any]:
    seen, place = bounces(flights, law), frames(flights, law)
    table_m = float(np.median(seen.height_m)) if len(seen.height_m) else 0.0
    metrics: dict[str, Any] = {
        "spindoe": {
            "position_error_m": summary(end_errors(flights, law, place.spin_to_position, table_m)),
            "old_law": {
                "position_error_m": summary(end_errors(flights, OLD_LAW, place.spin_to_position, table_m))
            },
        },
        "frames": {
            "gravity_m_s2": place.gravity_m_s2.tolist(),
            "drag_coefficient": place.drag_coefficient,
            "spin_to_position_rotvec_rad": place.spin_to_position.tolist(),
            "misfit_left_by_spin": place.unexplained,
            "pieces": place.segments,
            "ball_on_table_m": table_m,
        },
    }
    if len(seen.restitution):
        low, middle, high = np.percentile(seen.restitution, [25, 50, 75]).tolist()
        metrics["restitution"] = {
            "median": middle,
            "quartiles": [low, high],
            "count": len(seen.restitution),
        }
    return metrics
