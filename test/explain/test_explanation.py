"""What rewards say of strokes, step by step, of whom they are, of missed ones; and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, FIRST_ACTING_STEP
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.explain.explanation import Explanation, explain, fit_temperature, load_rewards, rank
from msrd_ros.learning.checkpoints import save_checkpoint
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.loading import load_robot
from quick_rewards import learn_quickly, missed, shipped_strokes
from sawyer import ROBOT

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0"


def test_a_step_stands_for_the_state_that_it_leads_to(unseen: list[Explanation]) -> None:
    for one in unseen:
        episode, steps = one.episode, len(one.episode.joint_position) - FIRST_ACTING_STEP - 1
        assert one.time_s.shape == one.task.shape == (steps,)
        assert one.ball.shape == one.paddle.shape == (steps, 3)
        assert one.strategy.shape == (steps, len(one.labels))
        assert one.time_s[0] == (FIRST_ACTING_STEP + 1) * CONTROL_PERIOD_S
        for step in (0, steps // 2, steps - 1):
            row = round(one.time_s[step] / CONTROL_PERIOD_S)
            assert np.array_equal(one.ball[step], episode.ball_position[row])
            place, _ = paddle_pose(ROBOT.model, episode.joint_position[row])
            assert np.allclose(one.paddle[step], place)


def test_rewards_are_those_that_training_reports(unseen: list[Explanation], learned: Learned) -> None:
    assert learned.rewards is not None
    one = unseen[0]
    seen = one.episode.observations[FIRST_ACTING_STEP:].astype(np.float32)
    count, joints = len(one.labels), ROBOT.joint_count
    stacked = torch.as_tensor(seen).expand(count, 1, *seen.shape)
    values = learned.rewards(Transitions.of(stacked, torch.zeros(count, 1, ACTING_STEPS, joints)))
    assert np.allclose(one.task, values.task[0], atol=1e-5)
    assert np.allclose(one.strategy, values.strategy.T, atol=1e-5)
    assert np.allclose(one.evidence, (values.combined - values.task).sum(dim=1), atol=1e-2)


def test_strokes_of_an_unseen_subject_are_mostly_known_by_their_rewards(unseen: list[Explanation]) -> None:
    named = [one.labels[int(one.posterior().argmax())] for one in unseen]
    right = sum(name == one.episode.label for name, one in zip(named, unseen, strict=True))
    assert right >= 4, named
    sides = [name.split("-")[0] for name in named]
    assert sides == [str(one.episode.label).split("-")[0] for one in unseen]


def test_a_posterior_is_the_softmax_of_the_summed_rewards(unseen: list[Explanation]) -> None:
    for one in unseen:
        for temperature in (1.0, 40.0):
            shares = one.posterior(temperature)
            assert shares.sum() == pytest.approx(1.0)
            ratio = np.log(shares[:, None] + 1e-300) - np.log(shares[None, :] + 1e-300)
            expected = (one.evidence[:, None] - one.evidence[None, :]) / temperature
            likely = one.evidence.max() - one.evidence < 500.0 * temperature
            near = likely[:, None] & likely[None, :]
            assert np.allclose(ratio[near], expected[near], atol=1e-6)
        assert one.posterior(40.0).argmax() == one.posterior().argmax()


def made_up(unseen: list[Explanation], own: int, evidence: list[float]) -> Explanation:
    """A stroke of that strategy with that evidence."""
    one = unseen[own]
    return replace(one, evidence=np.array([*evidence, *[-1e9] * (len(one.labels) - len(evidence))]))


def test_the_temperature_makes_shares_of_what_is_right_so_often(unseen: list[Explanation]) -> None:
    # Of ten strokes that say "first" by 60 nats, seven are.
    labelled = [made_up(unseen, 0 if number < 7 else 1, [60.0, 0.0]) for number in range(10)]
    shares = labelled[0].posterior(fit_temperature(labelled))
    assert shares[0] == pytest.approx(0.7, abs=0.01)
    assert labelled[0].posterior()[0] > 0.999


def test_rewards_that_are_always_right_are_not_made_surer_than_they_say(unseen: list[Explanation]) -> None:
    assert fit_temperature([made_up(unseen, 0, [60.0, 0.0])]) == 1.0


def test_strokes_of_other_strategies_do_not_calibrate(unseen: list[Explanation]) -> None:
    other = StrategyLabel.parse("lob", "test")
    stranger = replace(unseen[0], episode=replace(unseen[0].episode, label=other))
    assert fit_temperature([*unseen, stranger]) == fit_temperature(unseen)
    with pytest.raises(UserError, match="no stroke of a strategy that the rewards know"):
        fit_temperature([stranger])


def test_a_missed_stroke_ranks_below_the_returned_ones(learned: Learned, unseen: list[Explanation]) -> None:
    for one in unseen:
        lost = explain(learned, missed(one.episode))
        assert lost.struck is False
        assert rank(lost, unseen) == (0, len(unseen))
        assert lost.mean_task < one.mean_task


def test_ranks_count_who_is_lower(unseen: list[Explanation]) -> None:
    ordered = sorted(unseen, key=lambda one: one.mean_task)
    assert [rank(one, ordered).above for one in ordered] == list(range(len(ordered)))


def test_the_hit_is_the_referees_or_where_they_were_nearest(
    learned: Learned, unseen: list[Explanation]
) -> None:
    for one in unseen:
        assert one.episode.outcome is not None
        assert one.hit_s == one.episode.outcome.hit_time_s
        untold = explain(learned, replace(one.episode, outcome=None))
        assert untold.struck is None
        outside = replace(one.episode.outcome, hit_time_s=7.0)
        assert explain(learned, replace(one.episode, outcome=outside)).hit_s == untold.hit_s
        assert untold.hit_s == pytest.approx(one.hit_s, abs=2 * CONTROL_PERIOD_S)


def test_a_folder_means_the_checkpoint_in_it(checkpoint: Path, learned: Learned) -> None:
    states = shipped_strokes(3)[0].observations
    again = load_rewards(checkpoint.parent, ROBOT)
    assert np.array_equal(again.task_reward(states), learned.task_reward(states))


def test_what_the_library_saved_will_do(tmp_path: Path, learned: Learned) -> None:
    learned.save(tmp_path / "learned.safetensors")
    states = shipped_strokes(3)[0].observations
    again = load_rewards(tmp_path / "learned.safetensors", ROBOT)
    assert np.array_equal(again.task_reward(states), learned.task_reward(states))


def test_rewards_of_another_arm_are_refused_by_its_name(checkpoint: Path) -> None:
    with pytest.raises(UserError, match=r"checkpoint\.safetensors: is of the robot sawyer, not ur10e"):
        load_rewards(checkpoint, load_robot("ur10e"))


def test_rewards_of_other_observations_are_refused_by_their_columns() -> None:
    with pytest.raises(UserError, match=r"checkpoint\.safetensors: does not fit: .*has position, speed"):
        load_rewards(EARLIER / "checkpoint.safetensors", ROBOT)


def test_files_without_both_rewards_are_refused(
    tmp_path: Path, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file.safetensors"
    replace(learned, rewards=None).save(path)
    with pytest.raises(UserError, match=r"file\.safetensors: holds policies and no trained rewards"):
        load_rewards(path, ROBOT)
    save_checkpoint(path, learn_quickly(shipped_strokes(1), iterations=0))
    with pytest.raises(UserError, match=r"file\.safetensors: holds policies and no trained rewards"):
        load_rewards(path, ROBOT)
    assert learned.rewards is not None
    monkeypatch.setattr(learned.rewards, "form", RewardForm.STRATEGY_ONLY)
    learned.save(path)
    with pytest.raises(UserError, match=r"file\.safetensors: its rewards are not of states with R0 and S_i"):
        load_rewards(path, ROBOT)
