"""A stroke as a row of a table: what its bag says and what the inspection says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from msrd_ros.bags.info import BagInfo
from msrd_ros.bags.schemas import deserialise
from msrd_ros.bags.strokes import Stroke
from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.contract.labels import say_label
from msrd_ros.contract.outcome import RETURNED, Outcome
from msrd_ros.contract.topics import CONTRACT, OUTCOME
from msrd_ros.contract.translation import read_outcome
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.inspection import Origin, judge
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.outliers import missed_samples
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strokes.description import Description, met_side

ACCEPTED = "accepted"
PATH_PERIOD_S = 0.1
UNREADABLE = "unreadable"
"""The verdict on a bag that cannot be read; any other refusal is a miss reason or a `Refusal`."""


@dataclass(frozen=True)
class Row:
    """A stroke. What is not known is None, or empty where it is a text.

    Attributes
    ----------
    bag
        Path of its bag relative to the folder; ``.`` for the folder itself.
    ball_id
        Which ball, as the referee counted.
    subject, label
        Who showed what; ``unlabelled`` for a stroke that has no label.
    length_s
        Of the recording of this ball.
    outcome
        ``returned`` or the miss reason, as the referee said.
    spin_rad_s
        Of the ball right after the hit, about x, y and z of `world`, as the referee said.
    landing_m
        Where the ball first bounced on the far half, x and y in `world`, as the referee said.
    does
        What it does with the ball in a line, of one that came back: by that a person tells a stroke.
    verdict, detail
        ``accepted``, or why the stroke is no demonstration.
    flags
        What was noted of it when it was recorded, and what it is flagged with.
    jerk_rad_s3, distance_rad
        `outliers.rms_jerk`, and `outliers.distances` from the others of its label.
    ball_path_m
        Where the ball was every 0.1 s from the launch on, in `world`, for a small picture.
    missed
        Samples that are missing in flight, by topic.
    marks
        Why it is an outlier, one line a reason; empty: it is none.
    discarded
        Where it was, if it is discarded; empty: it is not.
    """

    bag: str
    ball_id: str = ""
    subject: str = ""
    label: str = ""
    length_s: float | None = None
    outcome: str = ""
    spin_rad_s: tuple[float, float, float] | None = None
    landing_m: tuple[float, float] | None = None
    does: str = ""
    verdict: str = UNREADABLE
    detail: str = ""
    flags: tuple[str, ...] = ()
    jerk_rad_s3: float | None = None
    distance_rad: float | None = None
    ball_path_m: tuple[tuple[float, float, float], ...] = ()
    missed: Mapping[str, int] | None = None
    marks: tuple[str, ...] = ()
    discarded: str = ""


class Measured(NamedTuple):
    """A stroke by itself, before it is compared with others.

    Attributes
    ----------
    row
        All but what the comparison tells.
    episode
        As arrays; None where the inspection finds more than that the ball was not returned.
    missed
        As `missed_samples` gives them.
    """

    row: Row
    episode: Episode | None
    missed: Mapping[str, tuple[int, int]]


def measure(stroke: Stroke, row: Row, info: BagInfo, robot: Robot, origin: Origin) -> Measured:
    """Inspect a stroke, and tell what is known of it.

    Parameters
    ----------
    stroke
        Of a bag.
    row
        What is known of the bag.
    info, origin
        The bag's.
    robot
        The arm that was led.
    """
    limits = InspectionLimits.of(info.custom_data)
    verdict, episode = judge(stroke, robot, limits, origin)
    if episode is None and stroke.outcome not in (None, "", RETURNED):
        # Whether the ball came back is no matter of how the arm moved.
        episode = judge(replace(stroke, outcome=None), robot, limits, origin).episode
    reason, detail = verdict.reason or ACCEPTED, verdict.detail
    if not info.kept:
        reason, detail = info.custom_data.get("reason") or reason, detail or "its recorder refused it"
    said = _said(stroke)
    row = replace(
        row,
        ball_id=stroke.ball_id,
        label=say_label(stroke.label),
        length_s=(stroke.messages[-1].log_time_ns - stroke.messages[0].log_time_ns) / 1e9,
        outcome=stroke.outcome or "",
        verdict=reason,
        detail=detail,
    )
    if episode is not None:
        places = episode.ball_position[:: round(PATH_PERIOD_S / CONTROL_PERIOD_S)].round(3).tolist()
        row = replace(row, ball_path_m=tuple((x, y, z) for x, y, z in places))
    missed = missed_samples(stroke)
    row = replace(row, missed={topic: missing for topic, (missing, _) in missed.items()})
    if said is not None:
        spin = (said.spin_x_rad_s, said.spin_y_rad_s, said.spin_z_rad_s)
        landing = (said.landing_x_m, said.landing_y_m)
        row = replace(
            row,
            spin_rad_s=spin if np.isfinite(spin).all() else None,
            landing_m=landing if np.isfinite(landing).all() else None,
        )
        if said.returned and episode is not None:
            row = replace(row, does=str(Description.of(met_side([episode]), [said])))
    return Measured(row, episode, missed)


def _said(stroke: Stroke) -> Outcome | None:
    """The referee's decision, as far as it can be read."""
    for message in reversed(stroke.messages):
        if message.topic == OUTCOME:
            try:
                return read_outcome(deserialise(message.data, CONTRACT[OUTCOME].type_name))[1]
            except UserError:
                return None
    return None
