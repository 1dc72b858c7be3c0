"""The divergence against what it is of Gaussians, and states that repeat."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.studies.lunar_lander.divergence import nearest_neighbour_divergence


@pytest.mark.parametrize("shift", [0.0, 1.0, 2.0])
def test_of_gaussians_it_is_half_the_squared_shift(shift: float) -> None:
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((2, 5000, 2))
    second[:, 0] += shift
    assert nearest_neighbour_divergence(first, second, 1e-10) == pytest.approx(0.5 * shift**2, abs=0.12)


def test_it_is_from_the_first_to_the_second() -> None:
    rng = np.random.default_rng(1)
    narrow, wide = 0.5 * rng.standard_normal((5000, 1)), rng.standard_normal((5000, 1))
    forth, back = (nearest_neighbour_divergence(*pair, 1e-10) for pair in ((narrow, wide), (wide, narrow)))
    assert forth == pytest.approx(np.log(2.0) + 0.125 - 0.5, abs=0.08)
    # The tails of the wide one are where the narrow one has no neighbours: there the estimate falls short.
    assert 0.55 < back < -np.log(2.0) + 2.0 - 0.5 + 0.08


def test_states_that_repeat_cost_the_logarithm_of_the_resolution() -> None:
    rng = np.random.default_rng(2)
    first, second = rng.standard_normal((2, 1000, 3))
    first[:500] = 0.0
    fine, coarse = (nearest_neighbour_divergence(first, second, size) for size in (1e-10, 1e-4))
    assert fine - coarse == pytest.approx(0.5 * 3.0 * np.log(1e6), rel=1e-6)


def test_where_both_rest_there_is_nothing_to_tell_apart() -> None:
    first, second = np.zeros((100, 8)), np.zeros((400, 8))
    assert nearest_neighbour_divergence(first, second, 1e-10) == pytest.approx(np.log(400 / 99))
