"""Evidence is that of the Gaussian it stands for, and steps that repeat each other count as fewer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from msrd_ros.learning.discovery.regression import Regressions, fit, fit_as_they_are
from msrd_ros.learning.discovery.same_policy import SamePolicy

RNG = np.random.default_rng(0)
FEATURES = [RNG.normal(size=(9, 3)) for _ in range(4)]
OUTPUTS = [table @ RNG.normal(size=(3, 2)) + 0.3 * RNG.normal(size=(9, 2)) for table in FEATURES]


def fitted() -> Regressions:
    """Four demonstrations of two outputs."""
    return fit_as_they_are(FEATURES, OUTPUTS)


def test_evidence_of_one_demonstration_is_that_of_a_gaussian() -> None:
    found, output = replace(fitted(), noise=np.array([0.1, 0.2]), signal=np.array([1.0, 2.0])), 1
    own = residual_outputs()
    covariance = 2.0 * FEATURES[0] @ FEATURES[0].T + 0.2 * np.eye(9)
    expected = multivariate_normal(np.zeros(9), covariance).logpdf(own[0][:, output])
    assert found.log_evidence(1.0)[0, output] == pytest.approx(expected)


def test_evidence_of_a_group_integrates_policy_and_departures_out() -> None:
    share = 0.2
    found = replace(fitted(), noise=np.array([0.1, 0.2]), signal=np.array([1.0, 2.0]))
    model = SamePolicy(found, share)
    grouped = model.log_evidence(model.statistics.sum(axis=0)[None], np.array([4.0]))[0] + model.constant
    everything, own = np.concatenate(FEATURES), np.concatenate(residual_outputs())
    same = np.kron(np.eye(4), np.ones((9, 9)))
    expected = 0.0
    for output in range(2):
        kernel = found.signal[output] * everything @ everything.T
        covariance = kernel * ((1.0 - share) + share * same) + found.noise[output] * np.eye(36)
        expected += multivariate_normal(np.zeros(36), covariance).logpdf(own[:, output])
    assert grouped == pytest.approx(expected)


def test_noise_that_lasts_makes_steps_worth_less() -> None:
    rng = np.random.default_rng(1)
    features = [np.ones((400, 1)) for _ in range(6)]
    white = [rng.normal(size=(400, 1)) for _ in range(6)]
    lasting = []
    for table in white:
        steps = [table[0]]
        for step in table[1:]:
            steps.append(0.8 * steps[-1] + step)
        lasting.append(np.array(steps))
    assert fit(features, white).correlation[0] == pytest.approx(1.0, abs=0.3)
    # (1 + 0.8) / (1 - 0.8) of an autoregression.
    assert 5.0 < fit(features, lasting).correlation[0] < 12.0


def residual_outputs() -> list[NDArray[np.float64]]:
    """What the outputs have beyond the weights that all share."""
    gram = sum(table.T @ table for table in FEATURES) + 1e-3 * 4 * np.eye(3)
    moments = sum(table.T @ output for table, output in zip(FEATURES, OUTPUTS, strict=True))
    weights = np.linalg.solve(gram, moments)
    return [output - table @ weights for table, output in zip(FEATURES, OUTPUTS, strict=True)]
