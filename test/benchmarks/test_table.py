"""The table of comparisons: ratios, numbers, and notes that are told once."""

from __future__ import annotations

import math

import pytest

from side_by_side.table import Comparison, markdown, number


@pytest.mark.parametrize(
    ("ours", "theirs", "less_is_better", "ratio"),
    [(30.0, 10.0, False, 3.0), (30.0, 10.0, True, 1 / 3), (2.0, 8.0, True, 4.0)],
)
def test_ratio_is_above_one_where_ours_is_better(
    ours: float, theirs: float, less_is_better: bool, ratio: float
) -> None:
    line = Comparison("what", "s", ours, "them", theirs, less_is_better)
    assert line.ratio == pytest.approx(ratio)


@pytest.mark.parametrize(("ours", "theirs"), [(math.nan, 1.0), (1.0, math.nan), (0.0, 1.0), (1.0, 0.0)])
def test_what_was_not_measured_has_no_ratio(ours: float, theirs: float) -> None:
    assert math.isnan(Comparison("what", "s", ours, "them", theirs).ratio)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (math.nan, "–"),
        (0.0, "0"),
        (0.01234, "0.0123"),
        (1.234, "1.23"),
        (123.4, "123"),
        (94178.0, "94,178"),
    ],
)
def test_numbers_have_three_digits_that_count(value: float, text: str) -> None:
    assert number(value) == text


def test_table_has_a_row_for_each_comparison_and_each_note_once() -> None:
    lines = [
        Comparison("read", "ms", 2.0, "rosbags 1", 6.0, less_is_better=True, note="on one thread"),
        Comparison("learn", "/s", 10.0, "imitation 1", note="it could not be installed"),
        Comparison("write", "ms", 2.0, "rosbags 1", 1.0, less_is_better=True, note="on one thread"),
        Comparison("record", "%", 45.0),
    ]
    text = markdown(lines, "2 cores")
    assert text.startswith("2 cores\n")
    rows = [row for row in text.splitlines() if row.startswith("|")]
    assert rows[0] == "| what | ours | beside | theirs | ratio |"
    assert rows[2:] == [
        "| read (1) | 2.00 ms | rosbags 1 | 6.00 ms | 3.00 |",
        "| learn (2) | 10.0 /s | imitation 1 | – | – |",
        "| write (1) | 2.00 ms | rosbags 1 | 1.00 ms | 0.500 |",
        "| record | 45.0 % | – | – | – |",
    ]
    assert text.count("on one thread") == 1
    assert "2. it could not be installed" in text
