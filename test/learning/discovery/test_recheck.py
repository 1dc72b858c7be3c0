"""Learned policies and rewards are held against the strategies they were trained as."""

from __future__ import annotations

import pytest

from gym_problems import quick, short, track_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.discovery.recheck import recheck


def test_what_was_learned_right_agrees_and_a_swap_is_noticed() -> None:
    data = track_demonstrations()
    learned = quick(config=short(iterations=15, cloning_steps=400))
    right = recheck(learned, data)
    assert right.moved == ()
    assert right.to_dict()["agree_by_policies"] == right.to_dict()["of"] == len(data.trajectories())
    labels = [label for _, _, label in data.trajectories()]
    labels[0] = next(label for label in labels if label != labels[0])
    swapped = recheck(learned, data, labels)
    assert swapped.moved == (0,)
    assert swapped.to_dict()["moved"] == [{"index": 0, "strategy": data.trajectories()[0][2]}]


def test_a_method_without_strategy_rewards_is_judged_by_its_policies() -> None:
    learned = quick(method="cloning", config=short(cloning_steps=400))
    assert recheck(learned, track_demonstrations()).reward is None


def test_labels_that_were_not_learned_are_refused() -> None:
    data, learned = track_demonstrations(), quick(method="cloning", config=short(cloning_steps=1))
    with pytest.raises(UserError, match="no strategy 'up' was learned; there are left, right"):
        recheck(learned, data, ["up"] * len(data.trajectories()))
    with pytest.raises(UserError, match="labels: 1 for"):
        recheck(learned, data, ["left"])
