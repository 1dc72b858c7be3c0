"""Evidence of a group is that of the distribution it stands for, and departures are told from strategies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_t

from msrd_ros.learning.discovery.partition import Partitions
from msrd_ros.learning.discovery.same_policy import NOISE_SCALE, NOISE_SHAPE, Regressions, SamePolicy

RNG = np.random.default_rng(0)
FEATURES = [RNG.normal(size=(9, 3)) for _ in range(4)]
OUTPUTS = [table @ RNG.normal(size=(3, 2)) + 0.3 * RNG.normal(size=(9, 2)) for table in FEATURES]


@pytest.mark.parametrize("members", [[2], [0, 1, 3]])
def test_evidence_of_a_group_integrates_policy_departures_and_noise_out(members: list[int]) -> None:
    ratio, share = 5.0, 0.2
    model = SamePolicy(Regressions(FEATURES, OUTPUTS), ratio, share)
    grouped = model.log_evidence(model.statistics[members].sum(axis=0)[None], np.array([len(members)]))[0]
    features = np.concatenate([FEATURES[member] for member in members])
    outputs = np.concatenate([OUTPUTS[member] for member in members])
    same = np.kron(np.eye(len(members)), np.ones((9, 9)))
    kernel = ratio * features @ features.T
    shape = NOISE_SCALE / NOISE_SHAPE * (kernel * ((1.0 - share) + share * same) + np.eye(len(same)))
    student = multivariate_t(np.zeros(len(same)), shape, df=2.0 * NOISE_SHAPE)
    assert grouped == pytest.approx(sum(student.logpdf(outputs[:, column]) for column in range(2)))


def test_one_policy_is_kept_together_and_two_are_not() -> None:
    weights = RNG.normal(size=(2, 3, 1))
    tables = [RNG.normal(size=(40, 3)) for _ in range(6)]
    done = [
        table @ weights[number % 2] + 0.1 * RNG.normal(size=(40, 1)) for number, table in enumerate(tables)
    ]
    search = Partitions(SamePolicy(Regressions(tables, done), 100.0, 1e-4), np.full(6, -1), 0.7)
    assert search.agglomerate(np.arange(6))[1].tolist() == [0, 1, 0, 1, 0, 1]
