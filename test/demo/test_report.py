"""The demo's report: what it says of strategies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.demo.report import _write_rates
from msrd_ros.reports.page import Report
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.description import Description
from msrd_ros.table_tennis.strokes.rates import LabelRates


def test_it_says_what_each_strategy_does(tmp_path: Path) -> None:
    label = ALL_LABELS[1]
    cut = Outcome(1, struck=True, miss_reason=None, landing_x_m=0.9, landing_y_m=0.4)
    balls = [
        replace(cut, spin_x_rad_s=0.0, spin_y_rad_s=-90.0, spin_z_rad_s=0.0),
        Outcome(2, struck=True, miss_reason=MissReason.NET),
    ]
    row = {
        **LabelRates.of(label, balls, None).to_json(),
        "description": Description.of(label.side, balls).to_json(),
        "demonstrations": 9,
    }
    report = Report("Strokes", "")
    _write_rates(report, {str(label): row})
    report.write(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "forehand, backspin (-90 rad/s), lands 0.90 m beyond the net, left (+0.40 m)" in page
    assert f"Balls not returned: {label}: 1 net." in page
