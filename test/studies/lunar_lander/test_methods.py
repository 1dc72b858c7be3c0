"""Yardsticks that learn nothing, and methods whose policies are kept."""

from __future__ import annotations

import numpy as np
import pytest
import torch

pytest.importorskip("Box2D")

from estimates import require_alike
from msrd_ros.studies.lunar_lander.demonstrations import load_demonstrations
from msrd_ros.studies.lunar_lander.environment import shaping_potential
from msrd_ros.studies.lunar_lander.methods import METHODS, PlayedEstimate, nearness, potential, slowness
from msrd_ros.studies.lunar_lander.task import LANDER
from msrd_ros.studies.shared.method import Budget, Exercise, restore


def test_nearness_is_the_mahalanobis_distance() -> None:
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((8, 8))
    demonstrated = rng.standard_normal((5000, 8)) @ mixing + 3.0
    reward = nearness(demonstrated)
    away = rng.standard_normal((7, 8))
    states = torch.as_tensor(demonstrated.mean(axis=0) + away, dtype=torch.float32)
    inverse = np.linalg.inv(np.cov(demonstrated.T))
    expected = -np.sqrt(np.einsum("ni,ij,nj->n", away, inverse, away))
    np.testing.assert_allclose(reward(states).numpy(), expected, rtol=1e-3)
    assert float(reward(torch.as_tensor(demonstrated.mean(axis=0), dtype=torch.float32))) == pytest.approx(
        0.0, abs=1e-2
    )


def test_slowness_and_potential() -> None:
    states = torch.tensor(
        [[0.0, 0.0, 3.0, -4.0, 0.0, 9.0, 0.0, 0.0], [0.3, 0.4, 0.0, 0.0, -0.5, 9.0, 1.0, 1.0]]
    )
    shown = np.zeros((2, 8))
    assert slowness(shown)(states).tolist() == [-5.0, 0.0]
    assert potential(shown)(states).tolist() == pytest.approx([-500.0, -100.0 * (0.5 + 0.5) + 20.0])
    assert shaping_potential(states.numpy()).tolist() == pytest.approx([-500.0, -80.0])


@pytest.mark.parametrize("method", ["msrd", "airl", "classifier", "nearness"])
def test_a_kept_run_says_and_does_the_same_as_the_run_itself(method: str) -> None:
    data = load_demonstrations().demonstrate(2)
    budget = Budget(iterations=1, episodes=1, horizon=40, cloning_steps=5, classifier_steps=10)
    exercise = Exercise(LANDER, data, budget, 5)
    estimate = METHODS[method].train(exercise)
    again = restore(METHODS[method], exercise, estimate.tensors())
    states = torch.as_tensor(data.observations[:, 0, 1::50], dtype=torch.float32)
    require_alike(estimate, again, states)
    assert (
        isinstance(estimate, PlayedEstimate)
        == isinstance(again, PlayedEstimate)
        == (method in ("msrd", "airl"))
    )
    if isinstance(estimate, PlayedEstimate) and isinstance(again, PlayedEstimate):
        assert torch.equal(again.cloned.flat(), estimate.cloned.flat())
        assert torch.equal(again.learned.flat(), estimate.learned.flat())
        assert not torch.equal(estimate.cloned.flat(), estimate.learned.flat())
