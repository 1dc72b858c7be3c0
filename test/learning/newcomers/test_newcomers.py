"""Teachers one by one: what they are taken for, what they leave as it is, and what plays them."""

from __future__ import annotations

import numpy as np
import pytest

from learning_problems import PointMass
from msrd_ros.core.errors import UserError
from msrd_ros.learning.newcomers.newcomers import Newcomers
from msrd_ros.learning.newcomers.recognition import Verdict
from newcomer_problems import between, config, far, known, learned, newcomers, to

STATES = np.random.default_rng(0).normal(size=(40, 2))


def met(
    group: Newcomers, pair: tuple[np.ndarray, np.ndarray], name: str | None = None
) -> tuple[str, Verdict]:
    meeting = group.meet([pair[0]], [pair[1]], name)
    return meeting.name, meeting.recognition.verdict


def test_a_known_strategy_is_left_alone() -> None:
    group = newcomers()
    assert met(group, to(1.0)) == ("to +1.0", Verdict.KNOWN)
    assert group.policies.layout.labels == learned().labels
    assert not group.mixtures


def test_a_mixture_gets_weights_and_a_policy_and_no_reward() -> None:
    group = newcomers()
    name, verdict = met(group, between(0.5))
    assert (name, verdict) == ("strategy-1", Verdict.MIXTURE)
    weights = group.mixtures[name]
    assert set(weights) == {"to +0.0", "to +1.0"}
    assert 0.3 < weights["to +1.0"] < 0.7
    assert group.learned.labels == learned().labels
    # It ends about where its teacher did.
    policy, state = group.policies.policy(name), np.zeros((1, 1, 2))
    world = PointMass()
    world.reset(1, 1, np.random.default_rng(1))
    for _ in range(world.acting_steps):
        state = world.step(np.asarray(policy.act(state)))
    assert state[0, 0, 0] == pytest.approx(0.5, abs=0.25)
    # The same again is the same mixture.
    assert met(group, between(0.5, seed=71)) == (name, Verdict.MIXTURE)
    assert len(group.policies.layout.labels) == 4


def test_what_is_new_gets_a_reward_and_everything_else_stays_to_the_bit() -> None:
    group = newcomers()
    before = group.learned
    meeting = group.meet([far()[0]], [far()[1]], "far away")
    assert meeting.recognition.verdict is Verdict.NEW
    assert meeting.episodes <= 58
    after = group.learned
    assert after.labels == (*before.labels, "far away")
    assert np.array_equal(after.task_reward(STATES), before.task_reward(STATES))
    for name in before.labels:
        assert np.array_equal(after.strategy_reward(name, STATES), before.strategy_reward(name, STATES))
        assert np.array_equal(after.policy(name).act(STATES), before.policy(name).act(STATES))
    own = after.strategy_reward("far away", far(61)[0]).mean()
    demonstrations = known()
    others = [after.strategy_reward("far away", shown).mean() for shown in demonstrations.observations[:, 0]]
    assert own > max(others)
    # From now on it is known.
    assert met(group, far(62)) == ("far away", Verdict.KNOWN)


def test_a_new_name_plays_though_the_strategy_is_known() -> None:
    group = newcomers()
    assert met(group, to(1.0), "mine") == ("mine", Verdict.KNOWN)
    assert group.mixtures == {"mine": {"to +1.0": 1.0}}
    assert np.array_equal(group.policies.policy("mine").act(STATES), learned().policy("to +1.0").act(STATES))


def test_what_is_shown_under_one_name_counts_together_and_can_be_forgotten() -> None:
    group = newcomers()
    met(group, far(), "far away")
    rewards = group.learned.strategy_reward("far away", STATES)
    met(group, far(63), "far away")
    assert group.learned.labels.count("far away") == 1
    assert not np.array_equal(group.learned.strategy_reward("far away", STATES), rewards)
    group.forget("far away")
    assert group.learned.labels == learned().labels
    assert np.array_equal(
        group.learned.strategy_reward("to +0.0", STATES), learned().strategy_reward("to +0.0", STATES)
    )
    assert met(group, far(64)) == ("strategy-1", Verdict.NEW)
    with pytest.raises(UserError, match=r"'to \+0.0' is none; there are strategy-1"):
        group.forget("to +0.0")


def test_the_same_seed_gives_the_same_result() -> None:
    first, second = newcomers(), newcomers()
    for group in (first, second):
        met(group, far())
    assert first.policies.digest == second.policies.digest


def test_bad_arrivals_are_refused_by_name() -> None:
    group = newcomers()
    seen, done = to(0.0)
    with pytest.raises(UserError, match=r"demonstration 0 has observations .* give \[T\+1, 2\] and \[T, 1\]"):
        group.meet([seen[:, :1]], [done])
    with pytest.raises(UserError, match="one state more than actions"):
        group.meet([seen[:9]], [done])
    with pytest.raises(UserError, match="not finite"):
        group.meet([np.where(seen > 0, np.nan, seen)], [done])
    with pytest.raises(UserError, match="one by one"):
        group.meet([seen, seen[:-1]], [done, done])
    with pytest.raises(UserError, match="0 arrays of observations"):
        group.meet([], [])
    with pytest.raises(UserError, match="people: 1 for 36 demonstrations"):
        Newcomers(learned(), known(), PointMass(), config(), people=["me"])
