"""The evidence of a group is that of its demonstrations one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_t

from msrd_ros.learning.discovery.mixture import Mixture, Spread, fitted_spread

RNG = np.random.default_rng(0)


def test_one_demonstration_alone_is_of_a_student_distribution() -> None:
    values = RNG.normal(size=(3, 2))
    spread = Spread(np.array([[1.0, 0.3], [0.3, 2.0]]), 7.0, 4.0)
    mixture = Mixture(values, spread)
    freedom = spread.freedom - 2 + 1
    expected = multivariate_t(np.zeros(2), spread.scale * 5.0 / freedom, df=freedom).logpdf(values)
    assert mixture.log_evidence(mixture.statistics, np.ones(3)) == pytest.approx(expected)


def test_the_scatter_of_groups_is_recovered() -> None:
    labels = np.repeat(np.arange(30), 20)
    covariance = np.array([[0.2, 0.1], [0.1, 0.3]])
    means = 3.0 * RNG.normal(size=(30, 2))
    values = means[labels] + RNG.multivariate_normal(np.zeros(2), covariance, size=600)
    spread = fitted_spread(values, labels, 8.0, 30.0)
    # The mean of the groups' precisions is what the scale is fitted to.
    assert spread.scale / 8.0 == pytest.approx(covariance, abs=0.05)
