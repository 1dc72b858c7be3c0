"""The study's report: how far predictions are off, beside the old law and the recordings' own noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.reports.page import Report
from msrd_ros.studies.ball.study import SPINS_RAD_S

Metrics = dict[str, Any]


def write_report(metrics: Metrics, folder: Path) -> Path:
    """Write ``report.html`` into `folder`; returns its path."""
    report = Report(
        "Flight and rebound",
        "Recorded balls, the law of this package, and the one before it.",
    )
    _law(report, metrics)
    if "flight" in metrics:
        _flight(report, metrics)
        _bounce(report, metrics["bounce"], metrics.get("noise"))
        _players(report, metrics)
    if "spindoe" in metrics:
        _spin_flights(report, metrics)
    path = folder / "report.html"
    report.write(path)
    return path


def _law(report: Report, metrics: Metrics) -> None:
    report.heading("The law")
    report.paragraph(
        "Drag and lift are rho A v^2 / 2 times a coefficient: the drag's is constant, the lift's is slope "
        "S / (1 + saturation S), S = r |spin| / v. The table gives back a share of the speed towards it and "
        "has friction. A recorded event has the position at its time and the velocity of the lag after it. "
        + (
            "Fitted here; spread: standard error by leaving out one player at a time."
            if metrics["fitted"]
            else "That of the package."
        )
    )
    spread = metrics.get("spread", {})
    rows = [[name, f"{value:.4g}", _spread(spread.get(name))] for name, value in metrics["law"].items()]
    report.table(["number", "value", "spread"], rows)
    if "gravity_left_free_m_s2" in metrics:
        free = metrics["gravity_left_free_m_s2"]
        report.paragraph(
            f"With gravity left free it comes out as {free['velocities_as_recorded']:.2f} m/s2 if velocities "
            f"are taken as recorded, and as {free['velocities_taken_as_late']:.2f} if they are taken as late."
        )


def _flight(report: Report, metrics: Metrics) -> None:
    flight, noise = metrics["flight"], metrics.get("noise")
    report.heading("Flight")
    report.paragraph(
        "Distance in cm of prediction and recording, in three dimensions at the recorded time, over pairs of "
        "successive events whose second is a bounce and whose first touched no net. Nothing stops the "
        "predicted ball at the table. Median / 90th percentile (count)."
        + (" Each player is judged by the law fitted to the others." if metrics["fitted"] else "")
    )
    columns = ("position_error_m", *SPINS_RAD_S)
    titles = ("all", *(name.replace("_", " ") + " rad/s" for name in SPINS_RAD_S))
    rows = [
        [name, *(_pair(found[column], 100.0) for column in columns)]
        for name, found in (
            ("this law", flight),
            ("this law, velocities not taken as late", flight["states_as_recorded"]),
            ("law of 0.1.0", flight["old_law"]),
            ("law of 0.1.0, velocities taken as late", flight["old_law_with_lag"]),
        )
    ]
    if noise is not None:
        rows.append(
            ["noise of the recordings alone", _pair(noise["flight_position_error_m"], 100.0), "", "", ""]
        )
    report.table(["", *titles], rows)
    onward = flight["to_next_shot"]
    report.paragraph(
        "From a bounce to the next shot, to which nothing was fitted: "
        f"{_pair(onward['position_error_m'], 100.0)} cm; law of 0.1.0: {_pair(onward['old_law'], 100.0)} cm."
    )
    if noise is not None:
        report.paragraph(
            f"In the {noise['short_pairs']} flights shorter than 0.2 s each axis of a position is off by "
            f"{1000 * noise['position_m']:.1f} mm and of a velocity by {noise['velocity_m_s']:.3f} m/s "
            "(standard deviations); the noise row is what these alone make of all flights."
        )


def _bounce(report: Report, bounce: Metrics, noise: Metrics | None) -> None:
    report.heading("Rebound")
    report.paragraph(
        "The state after the bounce, predicted from the event before it: velocity in m/s, spin in rad/s."
    )
    marks = ("velocity_error_m_s", "spin_error_rad_s")
    named = (
        ("this law", bounce),
        ("this law, velocities not taken as late", bounce["states_as_recorded"]),
        ("law of 0.1.0", bounce["old_law"]),
        ("law of 0.1.0, velocities taken as late", bounce["old_law_with_lag"]),
    )
    rows = [[name, *(_pair(found[mark]) for mark in marks)] for name, found in named]
    if noise is not None:
        rows.append(["noise of the recordings alone", *(_pair(noise[f"bounce_{mark}"]) for mark in marks)])
    report.table(["", "velocity", "spin"], rows)


def _players(report: Report, metrics: Metrics) -> None:
    report.heading("Players")
    laws = metrics.get("laws_without", {})
    names = list(next(iter(laws.values()))) if laws else []
    rows = [
        [player, _pair(found, 100.0), *(f"{laws[player][name]:.4g}" for name in names)]
        for player, found in metrics["flight"]["by_player"].items()
    ]
    report.table(["player", "flight, cm", *(f"{name} without them" for name in names)], rows)


def _spin_flights(report: Report, metrics: Metrics) -> None:
    found, place = metrics["spindoe"], metrics["frames"]
    gravity = np.array(place["gravity_m_s2"])
    tilt = np.degrees(np.arccos(-gravity[2] / np.linalg.norm(gravity)))
    report.heading("Flights with measured spin")
    report.paragraph(
        "A state is fitted to the first half of each flight, with the measured spin as what is expected; cm "
        "off at its end, which is where the ball touches anything but the table."
    )
    report.table(
        ["this law", "law of 0.1.0"],
        [[_pair(found["position_error_m"], 100.0), _pair(found["old_law"]["position_error_m"], 100.0)]],
    )
    turn = ", ".join(f"{angle:.2f}" for angle in place["spin_to_position_rotvec_rad"])
    report.paragraph(
        f"Gravity in the frame of the positions, from {place['pieces']} pieces of flight: "
        f"{np.linalg.norm(gravity):.2f} m/s2, {tilt:.1f} degrees off -z, so z points up. A ball on the table "
        f"has its centre at z = {1000 * place['ball_on_table_m']:.0f} mm. The spins are in another frame: "
        f"turned by the rotation vector ({turn}) rad they explain the flights' curves best and leave "
        f"{100 * place['misfit_left_by_spin']:.0f} % of the misfit that drag and gravity leave."
    )
    if "restitution" in metrics:
        seen = metrics["restitution"]
        low, high = seen["quartiles"]
        report.paragraph(
            f"Restitution of the table in {seen['count']} bounces seen from both sides: {seen['median']:.3f} "
            f"(quartiles {low:.3f} and {high:.3f})."
        )


def _pair(found: Metrics, scale: float = 1.0) -> str:
    digits = 2 if scale * found["median"] < 20.0 else 1
    return f"{scale * found['median']:.{digits}f} / {scale * found['p90']:.{digits}f} ({found['count']})"


def _spread(value: float | None) -> str:
    return "-" if not value or value < 1e-9 else f"± {value:.2g}"
