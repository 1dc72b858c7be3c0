"""What is told of rallies: how long they were, what ended them, and a film of the longest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.rally.play import PlayedRally, Track
from msrd_ros.reports.page import Report
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import End
from msrd_ros.table_tennis.simulation.render import FilmStudio, FilmStyle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILM_S = 12.0
"""The film shows so much of the longest rally, from its feed on."""
_FILM_TICKS = 2
"""Ticks a frame: 25 frames a second."""
_STILL_TICKS = 12
TWO_ARMS = FilmStyle(
    width=480, height=270, eye=(0.0, -6.4, 2.6), target=(0.0, 0.0, 0.85), view_angle_deg=27.5
)
"""From the side, with both ends in view."""


def figures(played: Sequence[PlayedRally]) -> dict[str, Any]:
    """What is kept of rallies in ``metrics.json``; lengths count strokes that brought the ball back."""
    lengths = np.array([rally.record.hits for rally in played])
    strokes = int(lengths.sum()) + sum(not rally.record.shots[-1].outcome.returned for rally in played)
    quartiles = np.percentile(lengths, (25, 50, 75))
    return {
        "rallies": len(played),
        "hits": {
            "median": float(quartiles[1]),
            "quartiles": [float(quartiles[0]), float(quartiles[2])],
            "mean": float(lengths.mean()),
            "most": int(lengths.max()),
            "all": lengths.tolist(),
        },
        "returned_share": float(lengths.sum() / strokes),
        "ends": dict(Counter(rally.end_reason for rally in played).most_common()),
        "strategies": dict(
            Counter(str(label) for rally in played for label in rally.strategies).most_common()
        ),
    }


def summary(metrics: dict[str, Any]) -> str:
    """The figures in a few lines."""
    hits = metrics["hits"]
    ends = ", ".join(f"{reason} {count}" for reason, count in metrics["ends"].items())
    low, high = hits["quartiles"]
    return (
        f"{metrics['rallies']} rallies: median {hits['median']:g} hits (quartiles {low:g} and {high:g}), "
        f"mean {hits['mean']:.1f}, longest {hits['most']}; {metrics['returned_share']:.1%} of strokes "
        f"returned the ball\nended by: {ends}"
    )


def write_report(out: Path, played: Sequence[PlayedRally], metrics: dict[str, Any], robot: Robot) -> None:
    """Write ``out/report.html`` with figures, stills and the film's name, and ``out/rally.gif``.

    Raises
    ------
    UserError
        If the page cannot be written.
    """
    hits = metrics["hits"]
    report = Report(
        "Two arms, one ball",
        f"{metrics['rallies']} rallies of two arms {robot.name} that play learned strategies at one table, "
        "each seeing the ball by a camera alone. A hit is a stroke that brought the ball back onto the other "
        "half.",
    )
    report.numbers(
        [
            (f"{hits['median']:g}", "hits, median rally"),
            (str(hits["most"]), "hits, longest rally"),
            (f"{metrics['returned_share']:.1%}", "of strokes returned the ball"),
            (str(metrics["limits_exceeded"]), "times over a joint limit"),
        ]
    )
    report.heading("How long rallies were")
    report.figure(_lengths(hits["all"]), "Share of rallies with at least so many hits.")
    report.heading("What ended them")
    report.table(["reason", "rallies"], list(metrics["ends"].items()))
    report.table(["strategy", "strokes"], list(metrics["strategies"].items()))
    longest = max(played, key=lambda rally: rally.record.hits)
    frames = film(robot, longest.track)
    report.heading("The longest rally")
    stills = frames[:: max(_STILL_TICKS // _FILM_TICKS, 1)][:6]
    report.picture(
        _grid(stills), f"Its first strokes, a picture every quarter of a second. Film: {FILM_NAME}."
    )
    report.write(out / "report.html")
    write_film(out / FILM_NAME, frames)


FILM_NAME = "rally.gif"


def film(robot: Robot, track: Track) -> list[NDArray[np.uint8]]:
    """Frames of a rally from its feed on, 25 a second, for `FILM_S` at most."""
    last = min(len(track.ball), round(FILM_S / CONTROL_PERIOD_S))
    with FilmStudio(robot, style=TWO_ARMS, both_ends=True) as studio:
        return [
            studio.frame(
                track.joints[End.NEAR][index],
                track.ball[max(index - 25, 0) : index + 1],
                track.joints[End.FAR][index],
            )
            for index in range(0, last, _FILM_TICKS)
        ]


def write_film(path: Path, frames: Sequence[NDArray[np.uint8]]) -> None:
    """Write frames as an animated picture."""
    images = [Image.fromarray(frame).quantize(96) for frame in frames]
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=round(1000 * _FILM_TICKS * CONTROL_PERIOD_S),
        loop=0,
    )


def _grid(frames: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    from msrd_ros.table_tennis.simulation.render import film_strip

    return film_strip(frames, columns=2)


def _lengths(lengths: Sequence[int]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.2), layout="constrained")
    axes = figure.add_subplot()
    ordered = np.sort(np.asarray(lengths))
    at = np.arange(ordered[-1] + 2)
    axes.step(at, [(ordered >= hits).mean() for hits in at], where="mid", color="#0072B2")
    axes.axvline(float(np.median(ordered)), color="#B3202A", linewidth=1.0)
    axes.set(xlabel="hits", ylabel="share of rallies", ylim=(0.0, 1.03), xlim=(0, None))
    return figure
