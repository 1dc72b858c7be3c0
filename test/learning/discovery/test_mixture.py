"""The evidence of a group is that of its demonstrations one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_t

from msrd_ros.learning.discovery.mixture import Mixture, Spread

RNG = np.random.default_rng(0)


def test_one_demonstration_alone_is_of_a_student_distribution() -> None:
    values = RNG.normal(size=(3, 2))
    spread = Spread(np.array([[1.0, 0.3], [0.3, 2.0]]), 7.0, 4.0)
    mixture = Mixture(values, spread)
    freedom = spread.freedom - 2 + 1
    expected = multivariate_t(np.zeros(2), spread.scale * 5.0 / freedom, df=freedom).logpdf(values)
    assert mixture.log_evidence(mixture.statistics, np.ones(3)) == pytest.approx(expected)
