"""What is shown under one name."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.learning.newcomers.arrivals import MOST_SHOWN, together
from msrd_ros.learning.newcomers.mixtures import same_mixture


def test_the_latest_count_together() -> None:
    first = np.arange(20.0).reshape(10, 2, 1), np.arange(10.0).reshape(10, 1, 1)
    second = -first[0], -first[1]
    seen, done = together("mine", first, second)
    assert len(seen) == len(done) == MOST_SHOWN
    assert np.array_equal(seen[-10:], second[0])
    assert np.array_equal(done[:2], first[1][-2:])
    with pytest.raises(UserError, match="newcomer mine: has 1 states, those before 2; choose another name"):
        together("mine", first, (second[0][:, :1], second[1]))


def test_mixtures_of_about_the_same_weights_are_the_same() -> None:
    known = {"half": {"a": 0.5, "b": 0.5}, "alone": {"c": 1.0}}
    assert same_mixture(known, {"a": 0.4, "b": 0.6}) == "half"
    assert same_mixture(known, {"a": 0.2, "b": 0.8}) is None
    assert same_mixture(known, {"b": 0.05, "c": 0.95}) == "alone"
