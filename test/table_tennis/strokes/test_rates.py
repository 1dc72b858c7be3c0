"""Rates of played balls: counts, Wilson intervals, landing points and classes of spin."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.table_tennis.strokes.rates import LabelRates, Rate, format_table

TOPSPIN, PUSH = StrategyLabel.parse("forehand-topspin"), StrategyLabel.parse("forehand-push")

pytestmark = pytest.mark.slow


def back(x: float, y: float, spin: float) -> Outcome:
    return Outcome(1, struck=True, miss_reason=None, landing_x_m=x, landing_y_m=y, spin_y_rad_s=spin)


BALLS = [
    back(0.9, 0.0, 90.0),
    back(0.9, 0.2, 80.0),
    back(0.9, 0.21, 10.0),
    back(0.6, -0.3, -90.0),
    Outcome(5, struck=True, miss_reason=MissReason.NET),
    Outcome(6, struck=False, miss_reason=MissReason.MISSED),
    Outcome(7, struck=False, miss_reason=MissReason.MISSED),
]


def wilson(count: int, total: int) -> tuple[float, float]:
    """Wilson (1927): the shares p with |count/total - p| = z sqrt(p (1 - p) / total)."""
    z = 1.959963984540054
    share = count / total
    centre = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * math.sqrt(share * (1 - share) / total + z * z / (4 * total**2))
    return centre - half, centre + half


@pytest.mark.parametrize(("count", "total"), [(0, 10), (1, 3), (85, 100), (100, 100), (9, 1000)])
def test_interval_is_wilsons(count: int, total: int) -> None:
    rate = Rate.of(count, total)
    assert (rate.low, rate.high) == pytest.approx(wilson(count, total), abs=1e-9)
    assert rate.low <= rate.share + 1e-12
    assert rate.high >= rate.share - 1e-12


def test_a_rate_of_nothing_says_nothing() -> None:
    rate = Rate.of(0, 0)
    assert math.isnan(rate.share)
    assert (rate.low, rate.high) == (0.0, 1.0)
    assert str(rate) == "-"


def test_balls_are_counted_for_what_they_were() -> None:
    row = LabelRates.of(TOPSPIN, BALLS, np.array([0.9, 0.0]))
    assert row.fed == 7
    assert (row.struck.count, row.struck.total) == (5, 7)
    assert (row.returned.count, row.returned.total) == (4, 7)
    assert (row.within_20cm.count, row.within_20cm.total) == (2, 4)
    assert row.spin_class_right is not None
    assert (row.spin_class_right.count, row.spin_class_right.total) == (2, 4)
    assert row.miss_reasons == {"net": 1, "missed": 2}
    assert row.spin_mean == pytest.approx(22.5)
    assert row.spin_sd == pytest.approx(np.std([90.0, 80.0, 10.0, -90.0]))


def test_each_ball_may_have_a_target_of_its_own() -> None:
    landed = [(ball.landing_x_m, ball.landing_y_m) if ball.returned else (0.5, 0.5) for ball in BALLS]
    near, far = np.add(landed, (0.0, 0.19)), np.add(landed, (0.0, 0.21))
    row = LabelRates.of(TOPSPIN, BALLS, np.concatenate([near[:2], far[2:]]))
    back = [ball.returned for ball in BALLS]
    assert (row.within_20cm.count, row.within_20cm.total) == (sum(back[:2]), 4)
    assert row.targets is not None
    np.testing.assert_array_equal(row.targets, np.concatenate([near[:2], far[2:]])[back])
    assert LabelRates.of(TOPSPIN, BALLS, np.array([0.9, 0.0])).targets is None


def test_a_spin_that_nobody_judges_is_null_and_a_dash() -> None:
    row = LabelRates.of(StrategyLabel.parse("my-smash"), BALLS, None)
    read = row.to_json()
    names = ("spin_class_right", "spin_class_right_share", "spin_class_right_interval")
    assert [read[name] for name in names] == [None, None, None]
    assert (read["returned"], read["spin_mean"]) == (4, pytest.approx(22.5))
    long_name = "a-name-longer-than-its-column"
    lines = format_table({"my-smash": row, long_name: row}).splitlines()
    assert [line.split()[-1] for line in lines[1:]] == ["-", "-"]
    assert lines[2].startswith(f"{long_name}  ")


@pytest.mark.parametrize("unknown", [None, np.full(2, np.nan)])
def test_without_a_landing_point_nothing_is_near_it(unknown: np.ndarray | None) -> None:
    row = LabelRates.of(TOPSPIN, BALLS, unknown)
    assert row.within_20cm.total == 0


@pytest.mark.parametrize("balls", [BALLS, BALLS[4:], []])
def test_report_is_strict_json_and_table_has_a_line_each(balls: list[Outcome]) -> None:
    row = LabelRates.of(PUSH, balls, None)
    read = json.loads(json.dumps(row.to_json(), allow_nan=False))
    assert read["fed"] == len(balls)
    assert read["struck"] == sum(ball.struck for ball in balls)
    assert read["returned_interval"] == [row.returned.low, row.returned.high]
    assert (read["spin_mean"] is None) == (not any(ball.returned for ball in balls))
    lines = format_table({"forehand-push": row, "backhand-push": row}).splitlines()
    assert [line.split()[0] for line in lines] == ["strategy", "forehand-push", "backhand-push"]
