"""Policy files of strokes: they read back exactly, and what the executor cannot play is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made_up_policies import made_up_policies, with_columns
from msrd_ros.contract.episode import action_names, observation_names
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokeFacts, StrokePolicies
from msrd_ros.table_tennis.strokes.reach import Reach
from processes import CHECKOUT
from sawyer import JOINT_COUNT, ROBOT

pytestmark = pytest.mark.slow


def test_a_file_reads_back_exactly(tmp_path: Path) -> None:
    policies = replace(made_up_policies(ALL_LABELS[:2]), exploration_seed=5, ready_noise_rad=0.02)
    unknown = StrokeFacts(policies.facts[ALL_LABELS[0]].ready_pose, np.full(2, np.nan), Side.BACKHAND)
    policies = replace(policies, facts={**policies.facts, ALL_LABELS[0]: unknown})
    path = tmp_path / "policies.safetensors"
    path.write_bytes(policies.to_bytes())
    read = StrokePolicies.load(path)
    assert (read.labels, read.digest) == (ALL_LABELS[:2], policies.digest)
    assert (read.exploration_seed, read.ready_noise_rad) == (5, 0.02)
    for label in read.labels:
        np.testing.assert_array_equal(read.facts[label].ready_pose, policies.facts[label].ready_pose)
        np.testing.assert_array_equal(read.facts[label].landing_point, policies.facts[label].landing_point)
    assert read.to_bytes() == policies.to_bytes()


def test_policies_that_take_a_target_read_back_with_their_reach() -> None:
    reach = replace(Reach.grid([0.4, 0.8], [-0.2, 0.2]), hits=np.array([[True, False], [True, True]]))
    policies = made_up_policies(ALL_LABELS[:2], reach=reach)
    read = StrokePolicies.from_bytes(policies.to_bytes(), "x")
    assert read.takes_target
    for facts in read.facts.values():
        assert facts.reach is not None
        np.testing.assert_array_equal(facts.reach.hits, reach.hits)
        np.testing.assert_array_equal(facts.reach.points, reach.points)
    assert read.to_bytes() == policies.to_bytes()


def test_without_a_target_the_teachers_mean_point_is_aimed_at() -> None:
    policies = made_up_policies(reach=Reach.grid([0.4, 0.8], [-0.2, 0.2]))
    label, seen = ALL_LABELS[2], np.linspace(-1.0, 1.0, 13)
    draws = StrokeDraws.of(0, 0, JOINT_COUNT)
    home = policies.play(label, draws, policies.facts[label].landing_point)(seen)
    np.testing.assert_array_equal(policies.play(label, draws)(seen), home)
    assert not np.allclose(policies.play(label, draws, np.array([0.4, -0.2]))(seen), home)


def test_policies_of_an_earlier_file_take_no_target_and_say_so() -> None:
    policies = StrokePolicies.load(CHECKOUT / "test" / "data" / "0.1.0" / "policies.safetensors")
    assert not policies.takes_target
    label = policies.labels[0]
    with pytest.raises(UserError, match="take no target; learn targets for them with `aim`"):
        policies.play(label, StrokeDraws.of(0, 0, JOINT_COUNT), np.array([0.7, 0.0]))
    with pytest.raises(UserError, match=f"the policy of {label} takes no target"):
        policies.facts[label].require_reach(np.array([0.7, 0.0]), str(label))


@pytest.mark.parametrize(
    "damage",
    [
        {"reach": None},
        {"reach": {"x_m": [0.4, 0.8], "y_m": [-0.2, 0.2], "hits": ["10"]}},
        {"reach": {"x_m": [0.8, 0.4], "y_m": [-0.2, 0.2], "hits": ["10", "11"]}},
        {"reach": {"x_m": [0.4, 0.8], "y_m": [-0.2, 0.2], "hits": ["1x", "11"]}},
    ],
)
def test_a_reach_that_is_no_grid_is_refused(damage: dict[str, Any]) -> None:
    policies = made_up_policies(ALL_LABELS[:1], reach=Reach.grid([0.4, 0.8], [-0.2, 0.2]))
    whole = StrokePolicies.from_bytes(policies.to_bytes(), "x").policies
    whole.details["strokes"][str(ALL_LABELS[0])].update(damage)
    with pytest.raises(UserError, match="x: forehand-push: the reach is no grid of targets"):
        StrokePolicies.from_bytes(whole.to_bytes(), "x")


def test_draws_are_the_strokes_own_and_means_take_none() -> None:
    policies = made_up_policies()
    label, seen = ALL_LABELS[3], np.linspace(-1.0, 1.0, 13)
    draws = StrokeDraws.of(7, 2, JOINT_COUNT)
    mean = policies.play(label, draws)
    np.testing.assert_array_equal(mean(seen), mean(seen))
    exploring = replace(policies, exploration_seed=7).play(label, draws)
    deviation = np.exp(policies.policies.policy(str(label)).log_std)
    for step in range(3):
        np.testing.assert_allclose(exploring(seen) - mean(seen), deviation * draws.action[step], atol=1e-6)
    np.testing.assert_array_equal(StrokeDraws.of(7, 2, JOINT_COUNT).action, draws.action)
    assert not np.array_equal(StrokeDraws.of(7, 3, JOINT_COUNT).ready, draws.ready)
    assert not np.array_equal(StrokeDraws.of(8, 2, JOINT_COUNT).ready, draws.ready)


def test_the_digest_tells_policies_and_their_explorations_apart() -> None:
    policies = made_up_policies()
    found = {
        policies.digest,
        made_up_policies(seed=1).digest,
        replace(policies, exploration_seed=1).digest,
        replace(policies, exploration_seed=2).digest,
    }
    assert len(found) == 4
    assert made_up_policies().digest == policies.digest


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (
            {"observation_names": (*observation_names(ROBOT)[:12], "wind")},
            "observations: lacks ball_velocity_z_m_s and has wind too many",
        ),
        ({"action_names": tuple(reversed(action_names(ROBOT)))}, "actions: same columns in another order"),
        ({"control_period_s": 0.01}, "control period 0.01 s, wanted 0.02 s"),
        ({"labels": ("forehand-push", "Lob")}, "'Lob' is no strategy label"),
        ({"labels": ("forehand-push", "my-lob")}, "the ready pose of my-lob is missing"),
    ],
)
def test_another_layout_is_refused_with_what_differs(columns: dict[str, Any], words: str) -> None:
    policies = with_columns(made_up_policies(ALL_LABELS[:2]), **columns)
    with pytest.raises(UserError) as raised:
        StrokePolicies.from_bytes(policies.to_bytes(), "old.safetensors")
    assert str(raised.value).startswith("old.safetensors: ")
    assert words in str(raised.value)


def test_ready_poses_are_needed_and_must_be_reachable() -> None:
    policies = made_up_policies(ALL_LABELS[:2])
    with pytest.raises(
        UserError, match="x: has no ready poses; give a policies file that the trainer node wrote"
    ):
        StrokePolicies.from_bytes(policies.policies.to_bytes(), "x")
    one = replace(policies, facts={ALL_LABELS[0]: policies.facts[ALL_LABELS[0]]})
    with pytest.raises(UserError, match="x: the ready pose of forehand-slice is missing"):
        StrokePolicies.from_bytes(one.to_bytes(), "x")
    pose = np.zeros(7)
    for value in (3.3, np.nan):
        pose[5] = value
        facts = {**policies.facts, ALL_LABELS[1]: StrokeFacts(pose, np.zeros(2), Side.FOREHAND)}
        with pytest.raises(
            UserError, match="ready pose of forehand-slice: joint right_j5 is out of its limits"
        ):
            StrokePolicies.from_bytes(replace(policies, facts=facts).to_bytes(), "x")


@pytest.mark.parametrize(
    ("details", "words"),
    [
        (None, "details are no mapping"),
        ("text", "details are no mapping"),
        ({"strokes": []}, "has no ready poses"),
        ({"exploration_seed": "x"}, "exploration_seed is 'x', not a whole number"),
        ({"exploration_seed": -1}, "exploration_seed is -1"),
        ({"ready_noise_rad": 5.0}, "ready_noise_rad is 5.0, not from 0 to 0.2"),
        ({"ready_noise_rad": None}, "ready_noise_rad is None"),
        ({"robot": None}, "is of the robot None, not sawyer"),
    ],
)
def test_malformed_details_are_refused_though_the_weights_are_whole(details: Any, words: str) -> None:
    policies = made_up_policies(ALL_LABELS[:1])
    if isinstance(details, dict):
        whole = StrokePolicies.from_bytes(policies.to_bytes(), "x").policies.details
        details = {**whole, **details}
    data = replace(policies.policies, details=details).to_bytes()
    with pytest.raises(UserError, match=f"^x: .*{words}"):
        StrokePolicies.from_bytes(data, "x")


@pytest.mark.parametrize(
    ("fact", "words"),
    [
        (None, "the ready pose of forehand-push is missing"),
        ({"ready_pose": None}, "ready pose of forehand-push has 1 joints, sawyer has 7"),
        ({"ready_pose": [0.0] * 6}, "ready pose of forehand-push has 6 joints, sawyer has 7"),
        ({"ready_pose": [0.0] * 8}, "ready pose of forehand-push has 8 joints, sawyer has 7"),
        ({"ready_pose": [0.0] * 6 + ["x"]}, "the ready pose of forehand-push does not hold numbers"),
        ({"landing_point": [0.1]}, r"landing point of forehand-push is \[0.1\], not x and y"),
        ({"landing_point": {}}, "the landing point of forehand-push does not hold numbers"),
        ({"landing_point": [float("inf"), 0.0]}, "landing point of forehand-push is"),
        ({"side": 3}, "the side of forehand-push is missing or unknown"),
    ],
)
def test_malformed_facts_are_refused_though_the_weights_are_whole(fact: Any, words: str) -> None:
    policies = made_up_policies(ALL_LABELS[:1])
    whole = StrokePolicies.from_bytes(policies.to_bytes(), "x").policies
    label = str(ALL_LABELS[0])
    stroke = fact if fact is None else {**whole.details["strokes"][label], **fact}
    details = {**whole.details, "strokes": {label: stroke}}
    with pytest.raises(UserError, match=f"^x: .*{words}"):
        StrokePolicies.from_bytes(replace(whole, details=details).to_bytes(), "x")


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("bias/0", lambda value: value[:, :, :-1], "tensor bias/0 has the shape"),
        ("weight/1", lambda value: value[:, :-1], "tensor weight/1 has the shape"),
        ("weight/0", lambda value: value[0], "a weight is no stack of matrices"),
        ("log_std", lambda value: value[:, :, :-1], "tensor log_std has the shape"),
        ("indices", lambda value: value - 1, "the first layer does not go with the observation"),
        ("indices", lambda value: value.astype(np.float32), "the first layer does not go"),
        ("scale", lambda value: 0.0 * value, "a column is scaled by zero"),
        ("offset", lambda value: value[:-1], "tensor offset has the shape"),
    ],
)
def test_weights_that_do_not_go_together_are_refused(name: str, change: Any, words: str) -> None:
    policies = made_up_policies(ALL_LABELS[:2])
    tensors = {**policies.policies.tensors, name: change(policies.policies.tensors[name])}
    data = replace(policies, policies=replace(policies.policies, tensors=tensors)).to_bytes()
    with pytest.raises(UserError, match=rf"x: damaged checkpoint \({words}"):
        StrokePolicies.from_bytes(data, "x")


def test_a_strategy_or_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match="no policy for strategy backhand-push; the checkpoint has forehand-push"
    ):
        made_up_policies(ALL_LABELS[:1]).require(ALL_LABELS[3])
    with pytest.raises(UserError, match=r"gone\.safetensors: cannot read the checkpoint \(No such file"):
        StrokePolicies.load(tmp_path / "gone.safetensors")
    (tmp_path / "pickle.safetensors").write_bytes(b"\x80\x04K\x01.")
    with pytest.raises(UserError, match=r"pickle\.safetensors: not a checkpoint of msrd_ros"):
        StrokePolicies.load(tmp_path / "pickle.safetensors")


def test_policies_of_0_1_0_are_the_sawyers_and_their_sides_those_of_their_names() -> None:
    path = Path(__file__).parents[2] / "data" / "0.1.0" / "policies.safetensors"
    policies = StrokePolicies.load(path)
    assert policies.robot == ROBOT
    assert policies.labels == tuple(ALL_LABELS)
    assert [facts.side for facts in policies.facts.values()] == [label.side for label in ALL_LABELS]
    with pytest.raises(UserError, match="sawyer, not ur10e; say robot:=sawyer"):
        StrokePolicies.load(path, load_robot("ur10e"))
