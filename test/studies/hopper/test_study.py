"""The Hopper study: its demonstrators, its marks, and the quick version as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from quick_studies import play, written_by_virtual_study

pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from msrd_ros.core.errors import UserError
from msrd_ros.learning.diayn import DiaynReward
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.studies.hopper.demonstrator_training import GaitReward, choose_pair
from msrd_ros.studies.hopper.demonstrators import (
    KL_ENCOURAGED_PAIR,
    PAIRS,
    TUNING_PAIR,
    Recipe,
    cached_demonstrators,
    extrinsic,
    hopper_features,
    load_demonstrators,
    save_demonstrators,
)
from msrd_ros.studies.hopper.environment import FEATURE_NAMES, TRUNK_NAMES, is_healthy, mean_speed
from msrd_ros.studies.hopper.evaluation import judge, make_gait_test_set
from msrd_ros.studies.hopper.study import TASK_MARKS, summarise
from msrd_ros.studies.hopper.task import HOPPER, preset
from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.method import Budget
from msrd_ros.studies.shared.methods import PLAYING
from msrd_ros.studies.shared.statistics import RIVALS

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    folder = tmp_path_factory.mktemp("study")
    return folder, play("hopper", folder)


def test_quick_study_writes_every_method_and_a_self_contained_report(quick: tuple[Path, float]) -> None:
    methods = written_by_virtual_study("hopper", quick[0], pictures=2)
    for name in ("msrd", "msrd_as_printed", "vanilla_distillation", "airl_each", "airl_each_cross"):
        scores = methods[name]
        for mark in ("task_r", "task_r_pooled", "task_r_spearman", "task_r_unseen"):
            assert -1.0 <= scores[mark][0] <= 1.0
        assert np.array(scores["strategy_r"]).shape == (1, 2)
        assert np.array(scores["strategy_r_own"]).shape == (1, 2)


def test_quick_study_is_meaningful(quick: tuple[Path, float]) -> None:
    methods = json.loads((quick[0] / "metrics.json").read_text())["methods"]
    assert methods["msrd"]["task_r"][0] > 0.6
    assert min(methods["msrd"]["strategy_r"][0]) > 0.5


def test_second_run_takes_up_the_first_and_gives_the_same_numbers(quick: tuple[Path, float]) -> None:
    folder = quick[0]
    first = json.loads((folder / "metrics.json").read_text())
    seconds = play("hopper", folder)
    assert json.loads((folder / "metrics.json").read_text())["methods"] == first["methods"]
    assert seconds < 0.5 * quick[1]


@pytest.mark.parametrize("pair", [*PAIRS, KL_ENCOURAGED_PAIR, TUNING_PAIR])
def test_cached_pairs_hop_and_crawl_at_near_equal_speed(pair: str, tmp_path: Path) -> None:
    demonstrators = cached_demonstrators(pair)
    data = demonstrators.demonstrate(4, seed=77)
    speed = mean_speed(data.observations).mean(axis=1)
    assert speed.min() > 1.0
    assert abs(speed[0] - speed[1]) < 0.25 * speed.max()
    height = data.observations[..., 1].mean(axis=(1, 2))
    assert (is_healthy(data.observations[0]).mean(axis=1) > 0.95).mean() >= 0.75  # one fall in about 25
    assert height[0] > 1.0
    assert height[1] < 0.7  # chosen below 0.6 on four episodes
    save_demonstrators(tmp_path / "d.safetensors", demonstrators)
    again = load_demonstrators(tmp_path / "d.safetensors")
    states = torch.as_tensor(data.observations[:, 0, ::100], dtype=torch.float32).reshape(-1, 12)
    assert torch.equal(again.truth.table(states), demonstrators.truth.table(states))
    assert torch.equal(again.others.flat(), demonstrators.others.flat())
    assert again.recipe == demonstrators.recipe


def test_tests_take_the_mean_of_a_pairs_seeds_as_one_observation() -> None:
    rng = np.random.default_rng(0)
    pairs = [pair for pair in "abcd" for _ in range(3)]
    level = np.repeat([0.2, 0.5, 0.7, 0.9], 3)
    methods = {}
    for name, lead in {**dict.fromkeys(("airl", *RIVALS), 0.0), "msrd": 0.1}.items():
        task = level + lead + 0.01 * rng.standard_normal(12)
        methods[name] = dict.fromkeys(TASK_MARKS, task.tolist())
        methods[name] |= dict.fromkeys(
            ("strategy_r", "strategy_r_own"), np.stack([task, task], axis=1).tolist()
        )
    tests = summarise(methods, pairs)
    assert tests["strategy_r_msrd_over_airl_each"]["n"] == 8
    found = tests["task_r_msrd_over_airl"]
    assert found["n"] == 4
    assert found["mean_difference"] == pytest.approx(0.1, abs=0.01)
    assert found["p_one_tailed"] < 0.01
    assert found["wilcoxon_p"] == pytest.approx(0.5**4)  # all four pairs agree


def test_pairs_were_trained_apart() -> None:
    recipes = {pair: cached_demonstrators(pair).recipe for pair in (*PAIRS, KL_ENCOURAGED_PAIR, TUNING_PAIR)}
    assert len({recipe.seed for recipe in recipes.values()}) == len(recipes) == 10
    assert [pair for pair, recipe in recipes.items() if recipe.divergence_bound is not None] == [
        KL_ENCOURAGED_PAIR
    ]


def test_methods_that_were_tuned_by_themselves_keep_their_settings() -> None:
    hidden = {method: PLAYING[method].recipe(HOPPER, Budget()).reward.hidden for method in ("msrd", "airl")}
    assert hidden == {"msrd": (16, 16), "airl": (32, 32)}
    penalties = [
        PLAYING[method].recipe(HOPPER, Budget()).discriminator.penalty_weight
        for method in ("msrd", "msrd_as_printed", "vanilla_distillation")
    ]
    assert penalties == [0.003, 0.1, 0.003]


def test_truth_of_the_kl_encouraged_pair_is_bounded_divergence() -> None:
    demonstrators = cached_demonstrators(KL_ENCOURAGED_PAIR)
    bound = demonstrators.recipe.divergence_bound
    assert bound is not None
    states = torch.as_tensor(
        demonstrators.demonstrate(1, seed=77, horizon=200).observations[:, 0].reshape(-1, 12)
    )
    paid, unbounded = demonstrators.truth.table(states), demonstrators.truth.unbounded().table(states)
    others = demonstrators.recipe.strategies - 1
    assert 0.0 <= float(paid.min()) <= float(paid.max()) <= bound * others
    assert float(unbounded.max()) > bound * others
    assert bool((paid <= unbounded).all())


def test_damaged_demonstrators_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.safetensors"
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(UserError, match=r"d\.safetensors"):
        load_demonstrators(path)


def test_rule_takes_the_fastest_pair_of_near_equal_speed() -> None:
    speed = np.array([2.0, 3.0, 2.05, 2.9, 1.3, 0.5])
    hops = np.array([True, True, False, False, False, False])
    crawls = np.array([False, False, True, False, True, True])
    assert choose_pair(speed, hops, crawls) == (0, 2)
    crawls[3] = True
    assert choose_pair(speed, hops, crawls) == (1, 3)
    assert choose_pair(speed, hops, np.array([False] * 4 + [True, True])) == (0, 4)
    with pytest.raises(UserError, match="0 crawls"):
        choose_pair(speed, hops, np.array([False] * 5 + [True]))


def test_upright_trainees_pay_for_falls_and_get_nothing_for_getting_up() -> None:
    recipe = Recipe(upright=1, free=1, weight=0.0, healthy_bonus=1.0, fall_cost=50.0, speed_cap=2.5)
    diayn = DiaynReward(
        2, hopper_features(), (4,), extrinsic, recipe.weight, torch.Generator().manual_seed(0), steps=1
    )
    observations = np.zeros((2, 1, 4, 12), dtype=np.float32)
    observations[..., 1] = [1.2, 1.2, 0.5, 1.2]
    observations[..., 0] = [0.0, 2.0, 3.0, 4.0]
    rollouts = Rollouts(observations, np.zeros((2, 1, 3, 3), np.float32), np.zeros((2, 1, 3), np.float32))
    reward = GaitReward(diayn, recipe).reward(rollouts, None)  # type: ignore[arg-type]
    assert reward[0, 0].tolist() == pytest.approx([3.0, -47.5, 0.0])
    assert reward[1, 0].tolist() == pytest.approx([2.0, 3.0, 4.0])


def test_the_truth_itself_gets_full_marks_also_on_unseen_gaits() -> None:
    demonstrators = cached_demonstrators(TUNING_PAIR)
    test = make_gait_test_set(demonstrators, seed=55, repeats=1, clean=1)
    truth = Estimate(lambda states: states[:, 0], demonstrators.truth.table, None, {}, 0.0, 0)
    marks = judge(truth, test)
    for name in ("task_r", "task_r_pooled", "task_r_spearman", "task_r_unseen", "task_r_unseen_spearman"):
        assert marks[name] == pytest.approx(1.0, abs=1e-4)
    for name in ("strategy_r", "strategy_r_own", "strategy_r_clean", "strategy_r_acted", "task_r_each"):
        assert marks[name] == pytest.approx([1.0, 1.0], abs=1e-4)
    assert max(marks["strategy_r_unbounded"]) < 0.999
    assert marks["diagonal"] == 2


def test_the_truth_is_the_pseudo_reward_as_it_was_paid() -> None:
    demonstrators = cached_demonstrators(TUNING_PAIR)
    states = torch.zeros(1, 12)
    states[0, 1] = 1.25  # hop and crawl both start from here: nobody's floor
    paid, unbounded = demonstrators.truth, demonstrators.truth.unbounded()
    flying = torch.as_tensor(demonstrators.demonstrate(1, seed=77, horizon=200).observations[0, 0, 100:])
    assert unbounded.table(flying)[1].min() < -6.0
    assert paid.table(flying)[1].min() == demonstrators.recipe.floor == -5.0
    assert torch.equal(paid.table(states).clamp(min=-5.0), unbounded.table(states).clamp(min=-5.0))


def test_no_network_sees_the_true_reward() -> None:
    settings = preset()
    for features in (settings.reward.strategy_features, settings.policy.features):
        assert features.names == FEATURE_NAMES
    assert settings.reward.task_features.names == TRUNK_NAMES
    assert settings.reward.task_features.scales == (0.5, 0.5, 2.0, 1.5, 3.0)
    assert hopper_features().indices.tolist() == list(range(1, 12))
