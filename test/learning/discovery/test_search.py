"""Few demonstrations are neither split by chance nor thrown together, and departures decide the model."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.learning.discovery.features import state_features
from msrd_ros.learning.discovery.same_policy import Regressions
from msrd_ros.learning.discovery.search import (
    MOST_DEPARTURES_OF_ONE_POLICY,
    Beliefs,
    evidence_alone,
    mixture_partition,
    same_policy_partition,
)


def unlabelled(count: int) -> Beliefs:
    """Nothing is said of any."""
    return Beliefs(np.full(count, -1), 0.7)


@pytest.mark.parametrize("seed", range(5))
def test_a_handful_of_one_way_is_one_group(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = mixture_partition(rng.normal(size=(9, 3)), unlabelled(9), rng)
    assert found.labels.max() == 0


@pytest.mark.parametrize("seed", range(5))
def test_pairs_that_are_far_apart_are_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres = 4.0 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [1, 0, 0], [-1, -1, -1]])
    values = np.repeat(centres, 2, axis=0) + 0.3 * rng.normal(size=(12, 3))
    found = mixture_partition(values, unlabelled(12), rng)
    assert found.labels.tolist() == np.repeat(np.arange(6), 2).tolist()


@pytest.mark.parametrize(
    ("departure", "noise", "one"), [(0.0, 0.1, True), (0.3, 0.3, True), (0.3, 0.01, False)]
)
def test_departures_that_noise_does_not_hide_are_no_single_policy(
    departure: float, noise: float, one: bool
) -> None:
    rng = np.random.default_rng(0)
    weights = np.repeat(rng.normal(size=(4, 5, 2)), 5, axis=0) + departure * rng.normal(size=(20, 5, 2))
    tables = [rng.normal(size=(100, 5)) for _ in weights]
    done = [
        table @ own + noise * rng.normal(size=(100, 2)) for table, own in zip(tables, weights, strict=True)
    ]
    found, departures = same_policy_partition(Regressions(tables, done), unlabelled(20), rng)
    assert (departures <= MOST_DEPARTURES_OF_ONE_POLICY) == one
    if departure == 0.0:
        assert found.labels.tolist() == np.repeat(np.arange(4), 5).tolist()


def test_features_that_express_the_policies_have_the_higher_evidence() -> None:
    rng = np.random.default_rng(0)
    tables = [rng.normal(size=(200, 1)) for _ in range(4)]
    done = [np.sin(3.0 * table) + 0.1 * rng.normal(size=(200, 1)) for table in tables]
    fine, coarse = (Regressions(state_features(tables, length, rng), done) for length in (0.5, 8.0))
    assert evidence_alone(fine, unlabelled(4)) > evidence_alone(coarse, unlabelled(4)) + 3.0
