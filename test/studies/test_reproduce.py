"""The reproduce command: the quick study as a user runs it, and one clear line for bad input."""

from __future__ import annotations

import json
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from estimates import require_alike
from msrd_ros.cluster.places import Place
from msrd_ros.cluster.processes import Processes, ThisProcess
from msrd_ros.cluster.workers import UnitsError, silent
from msrd_ros.core.code import code_digest
from msrd_ros.core.errors import UserError
from msrd_ros.studies import reproduce
from msrd_ros.studies.inverted_pendulum.demonstrators import (
    Kind,
    cached_demonstrators,
    load_demonstrators,
    save_demonstrators,
)
from msrd_ros.studies.inverted_pendulum.environment import has_fallen, task_reward
from msrd_ros.studies.inverted_pendulum.study import PENDULUM, StudyPlan
from msrd_ros.studies.inverted_pendulum.truths import KnownPreferences
from msrd_ros.studies.reproduce import STUDIES, main
from msrd_ros.studies.shared.cache import cached
from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.evaluation import correlation, evaluate, make_test_set, normalised
from msrd_ros.studies.shared.frozen_rewards import frozen_rewards, pessimistic
from msrd_ros.studies.shared.method import Budget, Exercise, restore
from msrd_ros.studies.shared.methods import METHODS
from msrd_ros.studies.shared.runs import prepare
from msrd_ros.studies.shared.statistics import diagonal_test, paired_test
from quick_studies import play, written_by_virtual_study

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    folder = tmp_path_factory.mktemp("study")
    return folder, play("inverted_pendulum", folder)


def test_quick_study_writes_every_method_and_a_self_contained_report(quick: tuple[Path, float]) -> None:
    methods = written_by_virtual_study("inverted_pendulum", quick[0], pictures=4)
    for name in ("msrd", "msrd_as_printed", "vanilla_distillation", "airl_each", "airl_each_cross"):
        scores = methods[name]
        assert -1.0 <= scores["task_r"][0] <= 1.0
        assert np.array(scores["strategy_r"]).shape == (1, 20)
        assert 0 <= scores["diagonal"][0] <= 20


def test_quick_study_is_meaningful(quick: tuple[Path, float]) -> None:
    methods = json.loads((quick[0] / "metrics.json").read_text())["methods"]
    assert methods["msrd"]["task_r"][0] > 0.8
    assert np.mean(methods["msrd"]["strategy_r"]) > 0.4
    assert methods["classifier"]["diagonal"][0] >= 15


def test_second_run_takes_up_the_first_and_gives_the_same_numbers(quick: tuple[Path, float]) -> None:
    folder = quick[0]
    first = json.loads((folder / "metrics.json").read_text())
    seconds = play("inverted_pendulum", folder)
    second = json.loads((folder / "metrics.json").read_text())
    assert second["methods"] == first["methods"]
    assert seconds < 0.7 * quick[1]


@pytest.mark.parametrize("method", ["msrd", "airl", "classifier"])
def test_same_seed_same_numbers(method: str) -> None:
    data = cached_demonstrators(Kind.DIAYN).demonstrate(2, seed=9)
    budget = Budget(iterations=2, episodes=1, horizon=200, cloning_steps=20, classifier_steps=20)
    first, again, other = (
        METHODS[method].train(Exercise(PENDULUM, data, budget, seed)).tensors() for seed in (3, 3, 4)
    )
    names = [name for name in first if name.endswith("weights.0")]
    assert names
    for name in set(first) - {"cost"}:
        assert torch.equal(first[name], again[name]), name
    assert not all(torch.equal(first[name], other[name]) for name in names)


def test_runs_side_by_side_are_the_same_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    budget = Budget(iterations=1, horizon=100, cloning_steps=10, classifier_steps=10, members=2)
    plan = replace(StudyPlan.quick(), budget=budget, demonstrations=2)
    methods = ("msrd", "classifier")
    found = []
    for count in (0, 2):
        folder = tmp_path / str(count)
        folder.mkdir()
        runs = plan.runs(Kind.DIAYN, folder)
        with Place().open(count) as workers:
            prepare(workers, [(runs, methods, 1)], silent)
        assert len(list(folder.iterdir())) == len(methods)
        scores = runs.compare(methods, 1)["methods"]
        for row in scores.values():
            del row["seconds"]
        found.append(scores)
    assert found[0] == found[1]
    assert len(found[0]["msrd"]["task_r_members"][0]) == 2


def test_an_ensemble_says_the_mean_of_its_members() -> None:
    data = cached_demonstrators(Kind.DIAYN).demonstrate(2, seed=9)
    budget = Budget(iterations=1, horizon=100, cloning_steps=10, members=3)
    estimate = METHODS["msrd"].train(Exercise(PENDULUM, data, budget, 5))
    states = torch.as_tensor(data.observations[:, 0, ::25]).reshape(-1, 4)
    assert len(estimate.members) == 3
    assert sum(member.environment_steps for member in estimate.members) == estimate.environment_steps
    for name in ("task", "strategies", "combined"):
        mean = torch.stack([getattr(member, name)(states) for member in estimate.members]).mean(dim=0)
        torch.testing.assert_close(getattr(estimate, name)(states), mean)
    alone = METHODS["msrd"].train(Exercise(PENDULUM, data, replace(budget, members=1), 5))
    assert alone.members == ()
    one, first = alone.task, estimate.members[0].task
    assert one
    assert first
    assert torch.equal(one(states), first(states))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["hopscotch"], "unknown study 'hopscotch'"),
        (["inverted_pendulum", "--seeds", "0"], "--seeds 0"),
        (["inverted_pendulum", "--seeds", "many"], "--seeds"),
        ([], "study"),
        (["inverted_pendulum", "--out", "/proc/nowhere"], "cannot write there"),
        (["inverted_pendulum", "--on", "cluster"], "--on cluster: say local, ray or ray://HOST:PORT"),
        (
            ["inverted_pendulum", "--on", "ray://head:1", "--workers", "3"],
            "--workers 3: the Ray at ray://head:1",
        ),
        (["inverted_pendulum", "--on", "ray://127.0.0.1:1"], "no Ray at ray://127.0.0.1:1"),
        (["inverted_pendulum", "--workers", "0"], "--workers 0"),
        (["ball", "--data", ".", "--on", "ray", "--workers", "2"], "leave out --on, --workers"),
    ],
)
def test_bad_input_gets_one_line(
    arguments: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "folders"),
    [
        (["hopper"], ["out/hopper"]),
        (["hopper", "--out", "here"], ["here"]),
        (["all"], [f"out/{name}" for name in STUDIES]),
        (["all", "--out", "here"], [f"here/{name}" for name in STUDIES]),
    ],
)
def test_studies_do_not_write_into_each_others_folder(
    arguments: list[str], folders: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    written: list[str] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reproduce, "_reproduce", lambda name, folder, *rest: written.append(str(folder)))
    assert main(arguments) == 0
    assert written == folders


def test_a_study_of_which_runs_failed_takes_none_along(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun = []

    def study(name: str, *rest: object) -> None:
        begun.append(name)
        if name == STUDIES[1]:
            raise UnitsError("1 of 2 failed: msrd, seed 0\n-- msrd, seed 0 --\nTraceback")

    monkeypatch.setattr(reproduce, "_reproduce", study)
    assert main(["all", "--out", str(tmp_path)]) == 1
    assert begun == list(STUDIES)
    printed = capsys.readouterr().err
    assert f"{STUDIES[1]}: 1 of 2 failed: msrd, seed 0" in printed
    assert "all other runs are kept" in printed


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [(["--quick"], ThisProcess), ([], Processes), (["--quick", "--workers", "2"], Processes)],
)
def test_runs_are_made_where_it_was_said(
    arguments: list[str], kind: type, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found: list[object] = []
    monkeypatch.setattr(reproduce, "_reproduce", lambda name, folder, workers, options: found.append(workers))
    assert main(["hopper", "--out", str(tmp_path), *arguments]) == 0
    assert [type(workers) for workers in found] == [kind]


def test_told_to_end_is_like_interrupted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(reproduce, "_reproduce", lambda *rest: signal.raise_signal(signal.SIGTERM))
    assert main(["hopper", "--out", str(tmp_path)]) == 130
    assert "goes on from here" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) is before


def test_missing_module_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "msrd_ros.studies.inverted_pendulum.report", None)
    assert main(["inverted_pendulum", "--out", str(tmp_path)]) == 2
    assert "install" in capsys.readouterr().err


@pytest.mark.parametrize("kind", Kind)
def test_cached_demonstrators_solve_the_task_and_survive_a_file(kind: Kind, tmp_path: Path) -> None:
    demonstrators = cached_demonstrators(kind)
    data = demonstrators.demonstrate(2, seed=77)
    count = len(demonstrators.report["kept"])
    assert count == 20 if kind is Kind.DIAYN else 8 <= count <= 20
    assert data.observations.shape == (count, 2, 1001, 4)
    assert has_fallen(data.observations).mean() < 0.1
    assert task_reward(data.observations).mean() > -0.05
    save_demonstrators(tmp_path / "d.safetensors", demonstrators)
    again = load_demonstrators(tmp_path / "d.safetensors")
    states = torch.as_tensor(data.observations[:, 0, ::100], dtype=torch.float32).reshape(-1, 4)
    assert torch.equal(again.truth.table(states), demonstrators.truth.table(states))
    assert again.recipe == demonstrators.recipe
    assert np.array_equal(again.demonstrate(2, seed=77).actions, data.actions)


def test_damaged_demonstrators_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.safetensors"
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(UserError, match=r"d\.safetensors"):
        load_demonstrators(path)


def test_the_truth_itself_gets_full_marks() -> None:
    demonstrators = cached_demonstrators(Kind.DIAYN)
    test = make_test_set(PENDULUM, demonstrators, seed=55, repeats=1, clean=2)
    truth = Estimate(
        lambda states: -states[:, 1].abs(),
        demonstrators.truth.table,
        None,
        {},
        seconds=0.0,
        environment_steps=0,
    )
    scores = evaluate(truth, test)
    assert scores.task_r == pytest.approx(1.0, abs=1e-5)
    assert scores.task_r_pooled == pytest.approx(1.0, abs=1e-5)
    assert scores.task_r_unfallen == pytest.approx(1.0, abs=1e-4)
    assert scores.task_r_unfallen_pooled == pytest.approx(1.0, abs=1e-4)
    assert scores.strategy_r == pytest.approx([1.0] * 20, abs=1e-5)
    assert scores.diagonal is not None
    assert scores.diagonal == test.truth_diagonal >= 19


def test_correlation_and_normalisation() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 50))
    assert correlation(first, second) == pytest.approx(np.corrcoef(first, second)[0, 1])
    assert correlation(first, np.ones(50)) == 0.0
    rows = normalised(np.array([[1.0, 3.0, 2.0], [5.0, 5.0, 5.0]]))
    assert rows.tolist() == [[0.0, 1.0, 0.5], [0.0, 0.0, 0.0]]


def test_paired_test_gives_the_papers_kind_of_numbers() -> None:
    rng = np.random.default_rng(0)
    ours = rng.normal(0.8, 0.2, 20)
    found = paired_test(ours, ours - rng.normal(0.1, 0.1, 20))
    assert found["n"] == 20
    assert found["t"] > 2.0
    assert found["p_one_tailed"] < 0.05
    assert found["wilcoxon_p"] < 0.05
    one_outlier = ours - np.array([0.01] * 19 + [-5.0])
    assert (
        paired_test(ours, one_outlier)["wilcoxon_p"] < 1e-3 < paired_test(ours, one_outlier)["p_one_tailed"]
    )
    assert paired_test(one_outlier, ours)["wilcoxon_p"] > 0.95
    assert diagonal_test(16, 20)["p"] < 1e-3
    assert diagonal_test(1, 20)["p"] > 0.5


def test_known_preferences_are_what_they_say() -> None:
    likes = KnownPreferences.twenty()
    states = torch.zeros(3, 4)
    states[1, 0], states[2, 2] = likes.targets[11], -0.3
    table = likes.table(states)
    assert table.shape == (20, 3)
    assert float(table[11, 1]) == 0.0
    assert float(table[14, 2]) == pytest.approx(0.0, abs=1e-6)
    assert float(table[0, 1]) == -4.0


def test_pessimism_costs_what_the_runs_disagree_about() -> None:
    def agreed(states: torch.Tensor) -> torch.Tensor:
        return states[..., 0]

    def other(states: torch.Tensor) -> torch.Tensor:
        return states[..., 0] + 4.0 * states[..., 1]

    states = torch.tensor([[1.0, 0.0], [2.0, 1.0]])
    assert pessimistic([agreed, other])(states).tolist() == pytest.approx([1.0, 2.0 + 2.0 - 2.0])
    assert torch.equal(pessimistic([other])(states), other(states))


@pytest.mark.parametrize("method", list(METHODS))
def test_a_kept_run_says_the_same_as_the_run_itself(method: str) -> None:
    demonstrators = cached_demonstrators(Kind.DIAYN)
    data = demonstrators.demonstrate(2, seed=9)
    budget = Budget(iterations=1, horizon=100, cloning_steps=10, classifier_steps=10)
    exercise = Exercise(PENDULUM, data, budget, 5, truth=demonstrators.truth)
    estimate = METHODS[method].train(exercise)
    again = restore(METHODS[method], exercise, estimate.tensors())
    states = torch.as_tensor(data.observations[:, 0, 1::50], dtype=torch.float32)
    require_alike(estimate, again, states)


def test_a_result_is_made_once(tmp_path: Path) -> None:
    calls = []

    def make() -> dict[str, object]:
        calls.append(1)
        return {"row": (0.1, None)}

    found = [cached(tmp_path / "found.json", make) for _ in range(2)]
    assert found == [{"row": [0.1, None]}] * 2
    assert len(calls) == 1


def test_other_code_is_another_key_and_another_report_is_not(tmp_path: Path) -> None:
    for name in ("learning/msrd.py", "studies/hopper/report.py", "nodes/trainer.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("before = 1\n")
    digests = [code_digest.__wrapped__(tmp_path)]
    for name in ("studies/hopper/report.py", "nodes/trainer.py", "learning/msrd.py"):
        (tmp_path / name).write_text("after = 2\n")
        digests.append(code_digest.__wrapped__(tmp_path))
    assert digests[0] == digests[1] == digests[2] != digests[3]


@pytest.mark.parametrize(
    "method",
    ["msrd", "airl", "airl_each", "classifier", "oracle", "supervised"],
)
def test_rewards_row_by_row_are_the_own_rows_of_the_table(method: str) -> None:
    demonstrators = cached_demonstrators(Kind.DIAYN)
    data = demonstrators.demonstrate(2, seed=9)
    budget = Budget(iterations=1, horizon=100, cloning_steps=10, classifier_steps=10, members=2)
    exercise = Exercise(PENDULUM, data, budget, 5, truth=demonstrators.truth)
    estimate = METHODS[method].train(exercise)
    states = torch.as_tensor(data.observations[:, 0, 1::50], dtype=torch.float32)
    assert estimate.strategies is not None or method == "airl"
    for name, rewards in frozen_rewards(estimate).items():
        own = rewards(states)
        assert own.shape == states.shape[:2], name
        for index, row in enumerate(states):
            judged = rewards(row)
            if judged.dim() == 2:
                judged = judged[index if len(judged) > 1 else 0]
            torch.testing.assert_close(own[index], judged)
