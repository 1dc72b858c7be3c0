"""The table tennis study: the quick version as a user runs it, and its parts one by one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import friedmanchisquare

from msrd_ros.cluster.processes import ThisProcess
from msrd_ros.contract.episode import CONTROL_PERIOD_S, HORIZON, Episode
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.studies.table_tennis.methods import MAIN_METHODS, METHODS, Budget, make_training
from msrd_ros.studies.table_tennis.playing import (
    Conditions,
    ReplayedMotions,
    evaluation_balls,
    play_balls,
)
from msrd_ros.studies.table_tennis.recording import StudyData, first_incomplete, load_episodes, split
from msrd_ros.studies.table_tennis.report import write_report
from msrd_ros.studies.table_tennis.results import pooled
from msrd_ros.studies.table_tennis.robustness import robustness_conditions
from msrd_ros.studies.table_tennis.statistics import diagonal_wins, friedman
from msrd_ros.studies.table_tennis.study import file_name
from msrd_ros.studies.table_tennis.undone import undo_return, untouched_path
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, SPREADS, STANDARD, Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from quick_studies import play

pytestmark = pytest.mark.slow

LABELS = [str(label) for label in ALL_LABELS]


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    folder = tmp_path_factory.mktemp("study")
    return folder, play("table_tennis", folder)


@pytest.fixture(scope="module")
def metrics(quick: tuple[Path, float]) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((quick[0] / "metrics.json").read_text())
    return content


@pytest.fixture(scope="module")
def shipped() -> list[Episode]:
    return load_episodes(shipped_bags(), lambda line: None)


@pytest.fixture(scope="module")
def data(shipped: list[Episode]) -> StudyData:
    return split(shipped, 1)


def test_metrics_hold_every_method_label_and_seed(metrics: dict[str, Any]) -> None:
    assert metrics["study"] == "table_tennis"
    assert metrics["seeds"] == [0]
    assert set(metrics["methods"]) == set(MAIN_METHODS)
    for method in metrics["methods"].values():
        assert list(method["labels"]) == LABELS
        for row in method["labels"].values():
            for name in ("fed", "struck", "returned", "within_20cm", "spin_mean", "spin_sd"):
                assert len(row[name]) == 1
            assert row["fed"][0] >= row["struck"][0] >= row["returned"][0] >= row["within_20cm"][0]
            low, high = row["pooled"]["returned"]["interval"]
            assert 0.0 <= low <= row["pooled"]["returned"]["share"] <= high <= 1.0
        assert len(method["training_seconds"]) == 1
        assert method["limits"][0]["exceeded"] == 0
    msrd = metrics["methods"]["msrd"]
    matrix = np.array(msrd["matrix"])
    assert matrix.shape == (1, 6, 6)
    assert np.allclose(matrix.max(axis=2), 1.0)
    assert np.allclose(matrix.min(axis=2), 0.0)
    assert msrd["diagonal"] == [diagonal_wins(matrix[0])]
    assert msrd["strategy_rewards"] == metrics["labels"]
    assert np.array(msrd["undone"]["real"]).shape == np.array(msrd["undone"]["undone"]).shape == (1, 18)
    assert 0.0 <= msrd["undone"]["friedman_p"] <= 1.0
    assert metrics["methods"]["airl"]["matrix"] == [None]
    assert metrics["methods"]["airl_each"]["diagonal"][0] is not None
    start = metrics["methods"]["behaviour_cloning"]["labels"]["forehand-push"]["returned"]
    assert metrics["methods"]["frozen_reward"]["labels"]["forehand-push"]["returned_at_start"] == start


def test_no_subject_is_on_both_sides(metrics: dict[str, Any]) -> None:
    subjects = metrics["subjects"]
    assert subjects["held_out"] == ["subject_03"]
    assert not set(subjects["training"]) & set(subjects["held_out"])


def test_robustness_table_has_its_rows(metrics: dict[str, Any]) -> None:
    assert list(metrics["robustness"]) == ["msrd", "cloning_with_noise"]
    for rows in metrics["robustness"].values():
        assert len(rows) == 2
        assert set(rows) <= set(robustness_conditions())
        for row in rows.values():
            assert row["labels"]["backhand-slice"]["fed"] == [1]


def test_tables_for_documents_say_what_was_measured(
    quick: tuple[Path, float], metrics: dict[str, Any]
) -> None:
    lines = (quick[0] / "tables.md").read_text().splitlines()
    for name, method in metrics["methods"].items():
        fed = sum(row["fed"][0] for row in method["labels"].values())
        missed = fed - sum(row["returned"][0] for row in method["labels"].values())
        (line,) = (line for line in lines if line.startswith(f"| {METHODS[name].title} |"))
        assert f"| {missed} of {fed} |" in line
    for condition in metrics["robustness"]["msrd"]:
        (line,) = (line for line in lines if line.startswith(f"| {condition} |"))
        assert line.count("|") == 4


def test_quick_study_is_meaningful(metrics: dict[str, Any]) -> None:
    def returned(method: str) -> int:
        return sum(row["returned"][0] for row in metrics["methods"][method]["labels"].values())

    assert returned("cloning_with_noise") > returned("open_loop")
    undone = metrics["methods"]["msrd"]["undone"]
    assert undone["share_in_order"][0] >= 0.9
    assert undone["friedman_p"] < 0.01


def test_report_is_self_contained(quick: tuple[Path, float]) -> None:
    report = (quick[0] / "report.html").read_text()
    assert report.count("data:image/png;base64") >= 4
    assert 'src="http' not in report
    assert "83 %" in report


def test_what_was_played_over_topics_stands_in_the_report(
    quick: tuple[Path, float], metrics: dict[str, Any], tmp_path: Path
) -> None:
    points = [
        {"seconds": 10.0 * n, "policies": n + 1, "fed": 24, "struck": 24, "returned": 12 + 4 * n}
        for n in range(4)
    ]
    rates = {label: {"fed": 50, "returned": 47} for label in LABELS}
    live = {"iterations": 3, "episodes": 7}
    played = metrics | {
        "plan": metrics["plan"] | {"live": live},
        "over_topics": {"batched": rates, "topics": rates},
        "hot_swap": points,
    }
    report = write_report(played, tmp_path).read_text()
    assert "47 of 50" in report
    assert "after 3 iterations of 7 rollouts" in report
    assert "4 sets were exchanged between strokes. Each point is 24 balls" in report
    assert "Over topics" not in (quick[0] / "report.html").read_text()


def test_second_run_takes_up_the_first_and_gives_the_same_numbers(
    quick: tuple[Path, float], metrics: dict[str, Any]
) -> None:
    assert play("table_tennis", quick[0]) < 0.7 * quick[1]
    again = json.loads((quick[0] / "metrics.json").read_text())
    assert again["methods"] == metrics["methods"]
    assert again["robustness"] == metrics["robustness"]


def test_friedman_is_the_formula_and_the_papers_number() -> None:
    in_order = np.stack([np.arange(9) + 1.0, np.arange(9.0)], axis=1)
    found = friedman(in_order)
    assert found.statistic == pytest.approx(9.0)
    assert found.freedom == 1
    assert found.p == pytest.approx(0.0027, abs=1e-4)
    table = np.random.default_rng(0).normal(size=(12, 4))
    ours, theirs = friedman(table), friedmanchisquare(*table.T)
    assert ours.statistic == pytest.approx(theirs.statistic)
    assert ours.p == pytest.approx(theirs.pvalue)
    assert friedman(np.ones((5, 2))).statistic == pytest.approx(0.0)


def test_diagonal_counts_rows() -> None:
    assert diagonal_wins(np.eye(6)) == 6
    assert diagonal_wins(np.roll(np.eye(3), 1, axis=1)) == 0


def test_pooled_shares() -> None:
    assert pooled([190, 200], [200, 200])["share"] == pytest.approx(0.975)
    assert pooled([0], [0])["share"] is None


def test_held_out_subjects_are_the_last_and_never_trained_on(shipped: list[Episode]) -> None:
    data = split(shipped, 1)
    assert {episode.subject for episode in data.training} == {"subject_01", "subject_02"}
    assert {episode.subject for episode in data.held_out} == {"subject_03"}
    assert len(data.training) + len(data.held_out) == len(shipped)
    points = data.landing_points
    mine = [e.outcome for e in data.training if e.label == ALL_LABELS[0]]
    assert points[ALL_LABELS[0]][0] == pytest.approx(np.mean([o.landing_x_m for o in mine if o]))
    with pytest.raises(UserError, match="too few"):
        split(shipped, 3)
    with pytest.raises(UserError, match="backhand-slice"):
        split([e for e in shipped if e.label != ALL_LABELS[4]], 1)


def test_recording_goes_on_with_the_first_incomplete_subject(tmp_path: Path) -> None:
    assert first_incomplete(tmp_path / "none", 3, 3) == 0
    assert first_incomplete(shipped_bags(), 3, 3) is None
    assert first_incomplete(shipped_bags(), 4, 3) == 3
    assert first_incomplete(shipped_bags(), 3, 4) == 0


@pytest.mark.parametrize("index", [0, 3])
def test_undone_return_keeps_what_was_before_the_hit_and_flies_past(
    shipped: list[Episode], index: int
) -> None:
    episode = next(e for e in shipped if e.label == ALL_LABELS[index])
    undone = undo_return(episode, 0.001, np.random.default_rng(0))
    assert episode.outcome is not None
    hit = int(episode.outcome.hit_time_s / CONTROL_PERIOD_S)
    assert np.array_equal(undone.ball_position[:hit], episode.ball_position[:hit])
    assert np.array_equal(undone.joint_position, episode.joint_position)
    assert undone.ball_position.shape == (HORIZON + 1, 3)
    # It goes on as it came: no jump, on past the robot's end of the table and down.
    steps = np.diff(undone.ball_position, axis=0)
    assert np.abs(np.diff(steps[hit - 3 : hit + 4, 0])).max() < 0.02
    assert undone.ball_position[-1, 0] < -1.4
    assert episode.ball_position[-1, 0] > 0.0
    assert undone.ball_position[:, 2].min() > 0.0
    assert np.allclose(undone.ball_velocity[hit + 2 :], steps[hit + 1 :] / CONTROL_PERIOD_S)
    with pytest.raises(UserError, match="when the ball was hit"):
        undo_return(replace(episode, outcome=None), 0.0, np.random.default_rng(0))


def test_untouched_path_is_the_true_one() -> None:
    launch = Feeder().sample(Side.FOREHAND, STANDARD, np.random.default_rng(3)).state()
    truth = ball_path(launch, CONTROL_PERIOD_S, 60, Scene().constants())[:, :3]
    seen = truth + 0.001 * np.random.default_rng(4).standard_normal(truth.shape)
    path, first = untouched_path(seen, 45)
    assert first <= 2
    assert np.linalg.norm(path - truth[first:], axis=1).max() < 0.02


def test_evaluation_balls_are_the_evaluators_and_the_same_for_everyone() -> None:
    balls = evaluation_balls(ALL_LABELS, 2, 7, STANDARD)
    again = evaluation_balls(ALL_LABELS, 2, 7, STANDARD)
    assert [ball.label for ball in balls[::2]] == list(ALL_LABELS)
    assert all(one.feed == two.feed for one, two in zip(balls, again, strict=True))
    rng = np.random.default_rng((EVALUATION_STREAM, 7))
    assert balls[0].feed == Feeder().sample(Side.FOREHAND, STANDARD, rng)
    assert not np.array_equal(balls[0].offset, balls[1].offset)


def test_replay_on_the_demonstrations_own_feed_and_posture_strikes(data: StudyData) -> None:
    label = ALL_LABELS[0]
    episodes = [episode for episode in data.training if episode.label == label][:3]
    balls = evaluation_balls([label], 3, 1, STANDARD)
    conditions = Conditions(ready_noise_rad=0.0)
    workers = ThisProcess()
    played = play_balls(workers, ReplayedMotions({label: episodes}), balls, conditions)
    again = play_balls(workers, ReplayedMotions({label: episodes}), balls, conditions)
    # The same balls give the same rallies, whatever was played before; only their count goes on.
    first, second = ([replace(o, ball_id=0) for o in one.outcomes] for one in (played, again))
    assert repr(first) == repr(second)
    assert played.limits.exceeded == 0
    assert played.limits.samples > 3000


@pytest.mark.parametrize(
    ("method", "form", "cross"),
    [
        ("msrd", RewardForm.TWO_COLUMN, True),
        ("msrd_as_printed", RewardForm.TWO_COLUMN, False),
        ("airl", RewardForm.TASK_ONLY, False),
        ("airl_each", RewardForm.STRATEGY_ONLY, False),
        ("airl_each_cross", RewardForm.STRATEGY_ONLY, True),
    ],
)
def test_methods_are_what_they_say(data: StudyData, method: str, form: RewardForm, cross: bool) -> None:
    config = make_training(METHODS[method], data, Budget(), 0).trainer.config
    assert config.reward.form is form
    assert (config.discriminator.cross_weight > 0.0) is cross
    assert config.cloning.recovery_labels
    assert config.policy.reference_price > 0.0


def test_every_condition_has_a_file_of_its_own() -> None:
    names = list(robustness_conditions())
    assert len({file_name(name) for name in names}) == len(names)


def test_forehand_and_backhand_may_share_a_strategy_reward(data: StudyData) -> None:
    budget = Budget(iterations=1, episodes=4, cloning_steps=5)
    training = make_training(METHODS["msrd_per_stroke"], data, budget, 0)
    assert training.reward_groups == ("push", "slice", "topspin")
    assert training.trainer.averaged_rewards.strategy_network.copies == 3
    assert training.strategy_matrix(data.held_out).shape == (3, 3)
    _, strategies = training.rewards_of(data.held_out[0].observations[None], 0)
    assert strategies[0] == strategies[3]
    training.trainer.clone()
    assert training.trainer.iterate()["environment_steps"] > 0
    assert make_training(METHODS["msrd"], data, Budget(), 0).reward_groups == tuple(map(str, ALL_LABELS))


def test_starts_and_worse_conditions_are_what_they_say(data: StudyData) -> None:
    plain = make_training(METHODS["msrd_plain_start"], data, Budget(), 0)
    assert not plain.trainer.config.cloning.recovery_labels
    assert plain.trainer.config.policy.reference_price == 0.0
    assert plain.simulator.config.variation.feed_spread == STANDARD
    randomised = make_training(METHODS["msrd_randomised"], data, Budget(), 0)
    usual = make_training(METHODS["msrd"], data, Budget(), 0)
    assert usual.trainer.config.cloning.recovery_labels
    assert usual.trainer.config.policy.reference_price > 0.0
    assert randomised.trainer.config == usual.trainer.config
    variation = randomised.simulator.config.variation
    assert (variation.feed_spread, variation.camera_noise_m, variation.camera_latency_s) == (
        SPREADS["twice"],
        0.003,
        0.02,
    )
