"""The study on made-up recordings: the law that made them is found, and every figure is there."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from made_up_recordings import ON_TABLE_M, SPIN_FRAME, write_events, write_flights
from msrd_ros.core.errors import UserError
from msrd_ros.studies.ball.fit import cross_validate, fit_law, found_gravity
from msrd_ros.studies.ball.law import LAW, OLD_LAW
from msrd_ros.studies.ball.noise import noise_floor
from msrd_ros.studies.ball.pairs import errors, pairs_to
from msrd_ros.studies.ball.recordings import read_events, read_flights
from msrd_ros.studies.ball.spin_flights import bounces, end_errors, frames
from msrd_ros.studies.ball.study import run_study
from msrd_ros.studies.reproduce import main

TRUE = replace(LAW, drag_coefficient=0.45, lift_slope=1.8, lift_saturation=4.0, friction=0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("recordings")
    write_events(place, TRUE, rallies=180)
    write_flights(place, TRUE)
    return place


def test_the_law_that_made_the_recordings_misses_nothing_and_is_found(folder: Path) -> None:
    events = read_events(folder)
    assert events is not None
    pairs = pairs_to(events, "bounce")
    assert len(pairs) == 180
    exact = errors(pairs, TRUE)
    assert max(exact.position.max(), exact.velocity.max()) < 1e-4
    assert exact.spin.max() < 1e-3
    assert np.median(errors(pairs, OLD_LAW).position) > 0.01
    found = fit_law(pairs, TRUE.restitution)
    for name, value in TRUE.numbers().items():
        assert getattr(found, name) == pytest.approx(value, rel=0.02), name
    assert found_gravity(pairs, found, late=True) == pytest.approx(9.81, abs=0.02)
    assert found_gravity(pairs, found, late=False) < 9.3
    held_out = cross_validate(pairs, TRUE.restitution)
    assert set(held_out.laws) == {"Player 0", "Player 1", "Player 2"}
    assert np.median(held_out.errors.position) < 1e-3


def test_noise_is_told_from_the_law(tmp_path: Path) -> None:
    write_events(tmp_path, TRUE, rallies=900, noise_m=0.01)
    events = read_events(tmp_path)
    assert events is not None
    pairs = pairs_to(events, "bounce")
    floor = noise_floor(pairs, TRUE)
    assert floor is not None
    expected = np.median(floor.positions_of(pairs))
    assert expected == pytest.approx(np.median(errors(pairs, TRUE).position), rel=0.2)


def test_frames_restitution_and_second_halves_of_flights(folder: Path) -> None:
    flights = read_flights(folder)
    assert flights is not None
    seen = bounces(flights, TRUE)
    assert len(seen.restitution) > 12
    assert np.median(seen.restitution) == pytest.approx(TRUE.restitution, abs=0.02)
    assert np.median(seen.height_m) == pytest.approx(ON_TABLE_M, abs=0.005)
    place = frames(flights, TRUE)
    np.testing.assert_allclose(place.gravity_m_s2, [0.0, 0.0, -9.81], atol=0.4)
    turned = Rotation.from_rotvec(place.spin_to_position) * SPIN_FRAME.inv()
    assert turned.magnitude() < 0.3
    assert place.unexplained < 0.7
    ends = end_errors(flights, TRUE, SPIN_FRAME.as_rotvec(), ON_TABLE_M)
    wrong = end_errors(flights, replace(TRUE, restitution=0.7), SPIN_FRAME.as_rotvec(), ON_TABLE_M)
    assert np.nanmedian(ends) < 0.02 < np.nanmedian(wrong)


@pytest.mark.parametrize("fit", [[], ["--fit"]])
def test_command_writes_the_promised_figures_and_a_report(
    folder: Path, tmp_path: Path, fit: list[str]
) -> None:
    assert main(["ball", "--data", str(folder), *fit, "--out", str(tmp_path)]) == 0
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    figures = [
        metrics["flight"]["position_error_m"],
        *(metrics["flight"][part] for part in ("below_100", "100_to_300", "above_300")),
        metrics["bounce"]["velocity_error_m_s"],
        metrics["bounce"]["spin_error_rad_s"],
        metrics["spindoe"]["position_error_m"],
    ]
    for figure in figures:
        assert set(figure) >= {"median", "p90", "count"}
        assert figure["count"] == 0 or 0.0 <= figure["median"] <= figure["p90"]
    assert sum(figure["count"] for figure in figures[1:4]) == figures[0]["count"] == 180
    assert metrics["fitted"] == bool(fit)
    assert (figures[0]["median"] < 0.002) == bool(fit)
    report = (tmp_path / "report.html").read_text()
    assert "Flights with measured spin" in report
    assert "nan" not in report


def test_either_kind_of_recording_will_do(tmp_path: Path) -> None:
    write_flights(tmp_path, TRUE, count=8)
    metrics = run_study(tmp_path, False, lambda _: None)
    assert "flight" not in metrics
    assert metrics["spindoe"]["position_error_m"]["count"] > 0
    with pytest.raises(UserError, match="--fit needs"):
        run_study(tmp_path, True, lambda _: None)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ball"], "cogsys-tuebingen/spindoe"),
        (["ball", "--data", "nowhere"], "no such folder"),
        (["ball", "--data", "."], "neither match_events.csv nor flights"),
        (["ball", "--quick"], "--quick"),
        (["flair", "--fit"], "--fit"),
    ],
)
def test_what_is_missing_or_has_no_effect_is_said(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err


def test_one_player_cannot_be_held_apart(tmp_path: Path) -> None:
    write_events(tmp_path, TRUE, rallies=60)
    file = tmp_path / "match_events.csv"
    file.write_text(file.read_text().replace("Player 1", "Player 0").replace("Player 2", "Player 0"))
    with pytest.raises(UserError, match="one player only"):
        run_study(tmp_path, True, lambda _: None)
