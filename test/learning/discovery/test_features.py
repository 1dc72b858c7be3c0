"""Courses tell motions apart whatever their length, and keep the scale of actions to each other."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from msrd_ros.learning.discovery.features import courses


def motions(quick: float = 1.0) -> list[NDArray[np.float64]]:
    """Three that turn to the left and three to the right, the second action being small and random."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, 1.0, 50)[:, None]
    sides = np.repeat([1.0, -1.0], 3)
    return [np.hstack([side * np.sin(3.0 * time), quick * rng.normal(size=(50, 1))]) for side in sides]


def test_the_first_number_tells_the_sides_apart() -> None:
    values = courses(motions(0.01), 2)
    assert values.shape == (6, 2)
    assert len(set(np.sign(values[:3, 0]))) == len(set(np.sign(values[3:, 0]))) == 1
    assert np.abs(values[:, 0]).min() > 10.0 * np.abs(values[:, 1]).max()


def test_the_common_unit_of_actions_does_not_matter_but_one_actions_own_does() -> None:
    once = courses(motions(), 3)
    assert np.abs(courses([40.0 * table for table in motions()], 3)) == pytest.approx(np.abs(once))
    assert np.abs(courses(motions(40.0), 3)) != pytest.approx(np.abs(once))


def test_actions_that_never_change_differ_in_nothing() -> None:
    assert not courses([np.zeros((10, 2))] * 3, 2).any()
