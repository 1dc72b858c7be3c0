"""The lander study as a user runs it, in its quick version, and what is kept of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quick_studies import play

pytest.importorskip("Box2D")

from msrd_ros.learning.recipe import default_config
from msrd_ros.studies.lunar_lander.demonstrations import SHIPPED, Recipe, load_demonstrations
from msrd_ros.studies.lunar_lander.methods import METHODS, PlayedMethod
from msrd_ros.studies.lunar_lander.study import SETS, StudyPlan
from msrd_ros.studies.lunar_lander.task import LANDER
from msrd_ros.studies.reproduce import main

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    folder = tmp_path_factory.mktemp("study")
    return folder, play("flair", folder)


def test_quick_study_writes_its_rows_and_a_self_contained_report(quick: tuple[Path, float]) -> None:
    metrics = json.loads((quick[0] / "metrics.json").read_text())
    assert metrics["study"] == "flair"
    assert set(metrics["methods"]) == set(StudyPlan.quick().methods)
    for name, scores in metrics["methods"].items():
        assert (scores["sets"][0] is None) == (name == "classifier")
        if scores["sets"][0] is not None:
            for marks in scores["sets"][0].values():
                assert -1.0 <= min(marks.values()) <= max(marks.values()) <= 1.0
    msrd, airl = (metrics["methods"][name] for name in ("msrd", "airl"))
    assert msrd["env_steps"] == airl["env_steps"]
    assert len(msrd["learned"][0]["returns"]) == len(airl["cloned"][0]["kl"]) == 10
    assert np.array(msrd["matrix"]).shape == (1, 10, 10)
    assert metrics["methods"]["classifier"]["diagonal"][0] >= 8
    assert {found["trajectories"] for found in metrics["sets"].values()} == {30}
    assert set(metrics["ceiling"]) == set(SETS)
    assert len(list((quick[0] / "runs").glob("ceiling-*.json"))) == 1
    report = (quick[0] / "report.html").read_text()
    assert "taught the true returns of the other set" in report
    assert report.count("data:image/png;base64") == 1
    assert 'src="http' not in report


def test_second_run_takes_up_the_first_and_gives_the_same_numbers(quick: tuple[Path, float]) -> None:
    folder, seconds = quick
    first = json.loads((folder / "metrics.json").read_text())
    again = play("flair", folder)
    assert json.loads((folder / "metrics.json").read_text())["methods"] == first["methods"]
    assert again < 0.5 * seconds


def test_the_two_sets_are_not_the_same_and_stay_with_their_settings(quick: tuple[Path, float]) -> None:
    plan, source = StudyPlan.quick(), load_demonstrations()
    sets = plan.test_sets(source, quick[0] / "runs")
    assert list(sets) == list(SETS) == ["A", "B"]
    assert not np.array_equal(sets["A"].observations, sets["B"].observations)
    paths = {plan.set_path(source, quick[0], name) for name in SETS}
    paths.add(replace(plan, sets=replace(plan.sets, trajectories=31)).set_path(source, quick[0], "A"))
    paths.add(plan.set_path(replace(source, recipe=Recipe("other")), quick[0], "A"))
    assert len(paths) == 4
    assert replace(plan, seeds=5, episodes=7).set_path(source, quick[0], "A") in paths


def test_methods_take_the_librarys_own_recipe() -> None:
    method = METHODS["msrd"]
    assert isinstance(method, PlayedMethod)
    assert method.recipe(LANDER, StudyPlan().budget) == default_config()
    assert StudyPlan().budget.members == 1


def test_demonstrations_of_a_file_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["flair", "--quick", "--data", str(tmp_path / "none.npz"), "--out", str(tmp_path)]) == 2
    assert "none.npz" in capsys.readouterr().err
    assert main(["hopper", "--data", str(SHIPPED), "--out", str(tmp_path)]) == 2
    assert "only flair" in capsys.readouterr().err
