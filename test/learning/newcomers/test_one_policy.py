"""Single policies: fitted from one that there is, and put into sets and taken out again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.newcomers.one_policy import fit_policy
from msrd_ros.learning.trajectories import Demonstrations
from newcomer_problems import known, learned, to


def test_it_starts_where_the_other_is_and_goes_where_the_demonstrations_are() -> None:
    start = learned().policy("to +1.0")
    seen, done = to(-0.5)
    shown = Demonstrations(seen[None, None], done[None, None], replace(known().layout, labels=("mine",)))
    generator = torch.Generator().manual_seed(0)
    same = fit_policy(start, shown, CloningConfig(steps=0), generator)
    states = np.random.default_rng(0).normal(size=(20, 2))
    assert same.label == "mine"
    assert np.allclose(same.act(states), start.act(states), atol=1e-6)
    fitted = fit_policy(start, shown, CloningConfig(steps=300), generator)

    def error(policy: object) -> float:
        return float(np.square(policy.act(seen[: len(done)]) - done).mean())  # type: ignore[attr-defined]

    assert error(fitted) < 0.1 * error(start)
    assert np.array_equal(fitted.log_std, start.log_std)


def test_sets_grow_and_shrink() -> None:
    policies = learned().policies
    extra = replace(policies.policy("to +0.0"), label="fourth")
    more = policies.with_policy(extra)
    assert more.layout.labels == (*policies.layout.labels, "fourth")
    states = np.random.default_rng(1).normal(size=(5, 2))
    for label in policies.layout.labels:
        assert np.array_equal(more.policy(label).act(states), policies.policy(label).act(states))
    assert np.array_equal(more.policy("fourth").act(states), extra.act(states))
    assert more.without("fourth").digest == policies.digest
    with pytest.raises(UserError, match="a policy for strategy 'fourth' already"):
        more.with_policy(extra)
    with pytest.raises(ValueError, match="other layers"):
        policies.with_policy(replace(extra, weights=extra.weights[:1], biases=extra.biases[:1]))
