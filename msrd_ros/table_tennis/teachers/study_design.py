"""The within-subjects study: who shows which stroke when, and which recordings are kept.

Every subject shows all six combinations of side and stroke; the order of the sides and the order of the
strokes are pseudo-randomised, balanced over the subjects; three recordings of each are kept, and what
failed is repeated (paper, Real-World Experiments, Experiment Design and Subjects).
"""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import numpy as np

from msrd_ros.contract.outcome import Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side, Strategies

Order = TypeVar("Order")

Condition = tuple[int, PaperLabel]
"""Index of a subject and what it shows."""


@dataclass(frozen=True)
class StudyConfig:
    """Size of a study.

    Attributes
    ----------
    subjects
        How many teachers take part.
    recordings
        Kept recordings wanted for each of a subject's six conditions.
    practice
        Strokes before the recording of each condition in which the subject gets used to the arm.
    attempts
        Most strokes recorded for one condition before the study moves on without the missing ones.
    """

    subjects: int = 10
    recordings: int = 3
    practice: int = 0
    attempts: int = 40

    def __post_init__(self) -> None:
        for name, least in (("subjects", 1), ("recordings", 1), ("practice", 0), ("attempts", 1)):
            if getattr(self, name) < least:
                raise UserError(f"study: {name} is {getattr(self, name)}; give at least {least}")
        if self.attempts < self.recordings:
            raise UserError(
                f"study: attempts ({self.attempts}) is less than recordings ({self.recordings}); raise it"
            )


class Verdict(StrEnum):
    """What becomes of a recorded stroke."""

    KEPT = "kept"
    NOT_RETURNED = "not_returned"
    WRONG_SPIN = "wrong_spin"
    """Returned, but with a spin that is not the asked stroke's: it did not resemble what was asked."""
    TOO_FAST = "too_fast"
    """A joint went more than 1 % over its speed limit."""
    ABORTED = "aborted"
    """The stroke could not be carried out, for example because the arm never got ready."""


SPEED_TOLERANCE = 1.01
"""Fraction of a joint's speed limit above which a stroke is refused."""


def judge_stroke(label: PaperLabel, outcome: Outcome, peak_speed_fraction: float) -> Verdict:
    """Whether a recorded stroke is kept, and if not, why.

    Parameters
    ----------
    label
        What was asked for.
    outcome
        The referee's decision on its ball.
    peak_speed_fraction
        Largest |joint rate| / speed limit over all joints and samples of the stroke.
    """
    if peak_speed_fraction > SPEED_TOLERANCE:
        return Verdict.TOO_FAST
    if not outcome.returned:
        return Verdict.NOT_RETURNED
    spin = Strategies.shipped().of(label).spin
    if spin is not None and spin.distance(outcome.spin_y_rad_s) > 0.0:
        return Verdict.WRONG_SPIN
    return Verdict.KEPT


def subject_name(index: int) -> str:
    """Name of a subject counted from 0: ``subject_01`` for the first."""
    return f"subject_{index + 1:02d}"


def condition_orders(subjects: int, rng: np.random.Generator) -> list[tuple[PaperLabel, ...]]:
    """Order of the six conditions for each subject.

    A subject finishes one side before the other. Over the subjects, each order of the sides comes up
    equally often, and so does each of the six orders of the strokes within the first and within the
    second side (as equally as the number of subjects allows: counts differ by one at most).
    """
    side_orders = _balanced(list(itertools.permutations(Side)), subjects, rng)
    first_strokes = _balanced(list(itertools.permutations(Stroke)), subjects, rng)
    second_strokes = _balanced(list(itertools.permutations(Stroke)), subjects, rng)
    return [
        tuple(
            PaperLabel(side, stroke)
            for side, strokes in zip(sides, blocks, strict=True)
            for stroke in strokes
        )
        for sides, *blocks in zip(side_orders, first_strokes, second_strokes, strict=True)
    ]


def _balanced(orders: list[Order], count: int, rng: np.random.Generator) -> list[Order]:
    """Draw `count` orders so that none comes up twice more often than another: shuffled whole sets."""
    drawn: list[Order] = []
    while len(drawn) < count:
        drawn += [orders[index] for index in rng.permutation(len(orders))]
    return drawn[:count]


@dataclass(frozen=True)
class Trial:
    """The stroke that is next.

    Attributes
    ----------
    subject
        Index from 0; `name` is for people and folders.
    label
        What the subject is asked to show.
    practice
        Whether it only serves to get used to the arm: never kept.
    attempt
        Strokes of this condition so far, this one included, practice counted apart.
    number
        Number that the recording gets if it is kept, from 1.
    """

    subject: int
    label: PaperLabel
    practice: bool
    attempt: int
    number: int

    @property
    def name(self) -> str:
        """Name of the subject."""
        return subject_name(self.subject)


class StudySession:
    """Runs the study, stroke by stroke: ask `trial`, carry it out, `tell` what became of it.

    Parameters
    ----------
    config
        Size of the study.
    rng
        Draws the orders; nothing else is random here.
    """

    def __init__(self, config: StudyConfig, rng: np.random.Generator) -> None:
        self.config = config
        self.orders = condition_orders(config.subjects, rng)
        self.verdicts: dict[Condition, Counter[Verdict]] = {}
        self.short: list[Condition] = []
        self._conditions: list[Condition] = [
            (subject, label) for subject, order in enumerate(self.orders) for label in order
        ]
        self._index = 0
        self._practised = 0

    @property
    def trial(self) -> Trial | None:
        """The stroke that is next, or None when the study is over."""
        if self._index >= len(self._conditions):
            return None
        subject, label = self._conditions[self._index]
        counts = self._counts
        practice = self._practised < self.config.practice
        attempt = self._practised + 1 if practice else counts.total() + 1
        return Trial(subject, label, practice, attempt, counts[Verdict.KEPT] + 1)

    @property
    def progress(self) -> tuple[int, int]:
        """Kept recordings so far, and how many are wanted in all."""
        kept = sum(counts[Verdict.KEPT] for counts in self.verdicts.values())
        return kept, len(self._conditions) * self.config.recordings

    def tell(self, verdict: Verdict) -> None:
        """Enter what became of the current trial and move on to the next.

        A condition is left when its recordings are complete, or when its attempts are used up; then it is
        entered in `short`. Telling of a practice stroke leaves no trace in `verdicts`.

        Raises
        ------
        UserError
            If the study is over already.
        """
        trial = self.trial
        if trial is None:
            raise UserError("study: told of a stroke after the last one; start a new study")
        if trial.practice:
            self._practised += 1
            return
        counts = self._counts
        counts[verdict] += 1
        complete = counts[Verdict.KEPT] >= self.config.recordings
        if not complete and counts.total() < self.config.attempts:
            return
        if not complete:
            self.short.append(self._conditions[self._index])
        self._index += 1
        self._practised = 0

    @property
    def _counts(self) -> Counter[Verdict]:
        return self.verdicts.setdefault(self._conditions[self._index], Counter())
