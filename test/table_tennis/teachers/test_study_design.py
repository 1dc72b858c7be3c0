"""The within-subjects design: balance, repetition, caps and verdicts."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest

from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.study_design import (
    StudyConfig,
    StudySession,
    Verdict,
    condition_orders,
    judge_stroke,
    subject_name,
)

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("subjects", [1, 5, 10, 12, 17])
def test_orders_are_complete_and_balanced(subjects: int) -> None:
    orders = condition_orders(subjects, np.random.default_rng(3))
    assert len(orders) == subjects
    for order in orders:
        assert sorted(order) == sorted(ALL_LABELS)
        assert len({label.side for label in order[:3]}) == 1, "one side is finished before the other"
    first_side = Counter(order[0].side for order in orders)
    assert max(first_side.values()) - min(first_side[side] for side in Side) <= 1
    for block in (slice(0, 3), slice(3, 6)):
        counts = Counter(tuple(label.stroke for label in order[block]) for order in orders)
        every = [counts[strokes] for strokes in itertools.permutations(Stroke)]
        assert max(every) - min(every) <= 1


def test_orders_come_from_the_generator() -> None:
    one, same, other = (condition_orders(10, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == same
    assert one != other


def test_session_practises_then_repeats_failures_until_enough_are_kept() -> None:
    session = StudySession(StudyConfig(subjects=2, recordings=3, practice=2), np.random.default_rng(0))
    seen: Counter[tuple[str, PaperLabel, bool]] = Counter()
    numbers: dict[tuple[str, PaperLabel], list[int]] = {}
    while (trial := session.trial) is not None:
        seen[trial.name, trial.label, trial.practice] += 1
        fails = not trial.practice and trial.attempt % 2 == 1
        if not trial.practice and not fails:
            numbers.setdefault((trial.name, trial.label), []).append(trial.number)
        session.tell(Verdict.NOT_RETURNED if fails else Verdict.KEPT)
    assert session.progress == (36, 36)
    assert not session.short
    for name, label in itertools.product(("subject_01", "subject_02"), ALL_LABELS):
        assert seen[name, label, True] == 2
        assert seen[name, label, False] == 6
        assert numbers[name, label] == [1, 2, 3]
    assert all(counts == {Verdict.NOT_RETURNED: 3, Verdict.KEPT: 3} for counts in session.verdicts.values())


def test_session_gives_a_condition_up_after_the_cap() -> None:
    session = StudySession(
        StudyConfig(subjects=1, recordings=2, practice=0, attempts=5), np.random.default_rng(0)
    )
    hopeless = session.orders[0][0]
    while (trial := session.trial) is not None:
        session.tell(Verdict.TOO_FAST if trial.label == hopeless else Verdict.KEPT)
    assert session.short == [(0, hopeless)]
    assert session.verdicts[0, hopeless][Verdict.TOO_FAST] == 5
    assert session.progress == (10, 12)
    with pytest.raises(UserError, match="study"):
        session.tell(Verdict.KEPT)


@pytest.mark.parametrize(
    ("stroke", "spin", "reason", "speed", "verdict"),
    [
        (Stroke.TOPSPIN, 110.0, None, 0.97, Verdict.KEPT),
        (Stroke.TOPSPIN, 110.0, None, 1.0101, Verdict.TOO_FAST),
        (Stroke.TOPSPIN, 20.0, None, 0.9, Verdict.WRONG_SPIN),
        (Stroke.PUSH, 50.0, None, 0.9, Verdict.WRONG_SPIN),
        (Stroke.SLICE, 100.0, None, 0.9, Verdict.WRONG_SPIN),
        (Stroke.PUSH, -6.0, None, 1.0099, Verdict.KEPT),
        (Stroke.SLICE, -100.0, MissReason.NET, 0.9, Verdict.NOT_RETURNED),
        (Stroke.SLICE, -100.0, None, 0.9, Verdict.KEPT),
    ],
)
def test_verdicts(
    stroke: Stroke, spin: float, reason: MissReason | None, speed: float, verdict: Verdict
) -> None:
    outcome = Outcome(ball_id=1, struck=True, miss_reason=reason, spin_y_rad_s=spin)
    assert judge_stroke(PaperLabel(Side.BACKHAND, stroke), outcome, speed) is verdict


def test_wrong_sizes_are_named() -> None:
    with pytest.raises(UserError, match="subjects"):
        StudyConfig(subjects=0)
    with pytest.raises(UserError, match="attempts"):
        StudyConfig(recordings=5, attempts=4)


def test_subject_names() -> None:
    assert [subject_name(index) for index in (0, 9)] == ["subject_01", "subject_10"]
