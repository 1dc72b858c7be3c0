"""Policies against torch.distributions, and their Fisher information against the Hessian of the KL."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
import torch
from torch.distributions import Categorical, Independent, Normal, kl_divergence

from msrd_ros.learning.categorical import CategoricalPolicies
from msrd_ros.learning.checkpoints import export_policies, import_policies
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies

FEATURES = Features((0, 1, 2), (0.1, 0.0, -0.1), (1.0, 2.0, 0.5))


def gaussian(seed: int = 0, strategies: int = 3) -> GaussianPolicies:
    policies = GaussianPolicies(
        strategies, FEATURES, 2, (6, 6), -0.7, -3.0, 0.5, torch.Generator().manual_seed(seed)
    )
    flat = policies.flat()
    noise = torch.randn(flat.shape, generator=torch.Generator().manual_seed(seed + 1))
    policies.set_flat(flat + 0.2 * noise)
    return policies


def states(count: int = 40, strategies: int = 3) -> torch.Tensor:
    return torch.randn(strategies, count, 3, generator=torch.Generator().manual_seed(9))


def reference(policies: GaussianPolicies) -> Independent[Normal]:
    mean, log_std = policies.distribution(states())
    return Independent(Normal(mean, log_std.exp().expand_as(mean)), 1)


def test_gaussian_log_prob_entropy_and_kl() -> None:
    old, new = gaussian(0), gaussian(4)
    actions = torch.randn(3, 40, 2, generator=torch.Generator().manual_seed(3))
    distribution = old.distribution(states())
    torch.testing.assert_close(old.log_prob(distribution, actions), reference(old).log_prob(actions))
    torch.testing.assert_close(old.entropy(distribution), reference(old).entropy().mean(dim=1))
    torch.testing.assert_close(
        old.kl(distribution, new.distribution(states())),
        kl_divergence(reference(old), reference(new)).mean(dim=1),
    )


def test_sampling_has_the_stated_mean_and_deviation() -> None:
    policies = gaussian()
    state = np.tile(states(1).numpy(), (1, 20000, 1))
    noise = np.random.default_rng(0).standard_normal((3, 20000, 2))
    actions = policies.act(state, noise)
    np.testing.assert_allclose(actions.mean(axis=1), policies.act(state)[:, 0], atol=0.02)
    deviation = policies.log_std.detach().exp().numpy()[:, 0]
    np.testing.assert_allclose(actions.std(axis=1), deviation, rtol=0.03)


def test_log_std_is_projected_into_its_bounds() -> None:
    policies = gaussian()
    flat = policies.flat()
    flat[:, -2], flat[:, -1] = 5.0, -9.0
    policies.set_flat(flat)
    assert policies.log_std[..., 0].eq(0.5).all()
    assert policies.log_std[..., 1].eq(-3.0).all()


def hessian_product(policies: Any, vector: torch.Tensor) -> torch.Tensor:
    """F v as the second derivative of KL(fixed || policies): independent of the Jacobian products."""
    old = policies.distribution(states())
    fixed = type(old)(*(part.detach() for part in old))
    parameters = [part for name, part in policies.named_parameters()]
    pairs = zip(policies.network.weights, policies.network.biases, strict=True)
    ordered = [part for pair in pairs for part in pair]
    ordered += [part for part in parameters if all(part is not other for other in ordered)]
    kl = policies.kl(fixed, policies.distribution(states())).sum()
    gradients = torch.autograd.grad(kl, ordered, create_graph=True)
    flat = torch.cat([gradient.flatten(1) for gradient in gradients], dim=1)
    second = torch.autograd.grad((flat * vector).sum(), ordered)
    return torch.cat([part.flatten(1) for part in second], dim=1)


def test_gaussian_fisher_is_the_hessian_of_the_kl() -> None:
    policies = gaussian()
    vector = torch.randn(policies.flat().shape, generator=torch.Generator().manual_seed(5))
    product = policies.fisher_metric(states()).product(vector)
    torch.testing.assert_close(product, hessian_product(policies, vector), rtol=1e-3, atol=1e-4)


def test_categorical_against_torch_distributions() -> None:
    policies = CategoricalPolicies(3, FEATURES, 4, (5,), torch.Generator().manual_seed(0))
    policies.set_flat(policies.flat() * 8.0)
    other = CategoricalPolicies(3, FEATURES, 4, (5,), torch.Generator().manual_seed(1))
    distribution = policies.distribution(states())
    truth = Categorical(logits=distribution.log_probs)
    actions = torch.randint(4, (3, 40, 1), generator=torch.Generator().manual_seed(2))
    log_prob = policies.log_prob(distribution, actions.float())
    torch.testing.assert_close(log_prob, truth.log_prob(actions[..., 0]))
    torch.testing.assert_close(policies.entropy(distribution), truth.entropy().mean(dim=1))
    second = other.distribution(states())
    expected = kl_divergence(truth, Categorical(logits=second.log_probs)).mean(dim=1)
    torch.testing.assert_close(policies.kl(distribution, second), expected)
    vector = torch.randn(policies.flat().shape, generator=torch.Generator().manual_seed(5))
    product = policies.fisher_metric(states()).product(vector)
    torch.testing.assert_close(product, hessian_product(policies, vector), rtol=1e-3, atol=1e-4)


def test_categorical_sampling_frequencies() -> None:
    policies = CategoricalPolicies(3, FEATURES, 4, (5,), torch.Generator().manual_seed(0))
    policies.set_flat(policies.flat() * 8.0)
    state = states(1)
    probs = policies.distribution(state).log_probs.exp()[:, 0].detach().numpy()
    noise = np.random.default_rng(0).standard_normal((3, 20000, 1))
    actions = policies.act(np.tile(state.numpy(), (1, 20000, 1)), noise)[..., 0]
    found = np.stack([(actions == choice).mean(axis=1) for choice in range(4)], axis=1)
    np.testing.assert_allclose(found, probs, atol=0.012)


def test_exported_policy_is_the_same_function_and_fast() -> None:
    policies = GaussianPolicies(3, FEATURES, 2, (64, 64), -1.0, -3.0, 0.5, torch.Generator().manual_seed(0))
    layout = Layout(("a", "b", "c"), ("u", "v"), ("first", "second", "third"), 0.02)
    exported = export_policies(policies, layout)
    observation = states(1).numpy()
    for index, label in enumerate(layout.labels):
        policy = exported.policy(label)
        found = policy.act(observation[index, 0])
        np.testing.assert_allclose(found, policies.act(observation)[index, 0], atol=1e-6)
    laps = []
    for _ in range(300):
        start = time.perf_counter()
        policy.act(observation[2, 0])
        laps.append(time.perf_counter() - start)
    assert np.median(laps) < 100e-6  # measured: about 10 us; the bound leaves room for a busy machine


def test_exported_policies_come_back_to_be_learned_further() -> None:
    policies = gaussian()
    layout = Layout(("a", "b", "c"), ("u", "v"), ("first", "second", "third"), 0.02)
    exported = export_policies(policies, layout, {"note": "x"})
    back = import_policies(exported)
    np.testing.assert_array_equal(back.act(states().numpy()), policies.act(states().numpy()))
    torch.testing.assert_close(back.log_std, policies.log_std)
    assert export_policies(back, layout).digest == exported.digest


def test_rollout_log_probs_match_single_evaluation() -> None:
    policies = gaussian()
    observations = np.random.default_rng(0).normal(size=(3, 2, 5, 3)).astype(np.float32)
    actions = np.random.default_rng(1).normal(size=(3, 2, 5, 2)).astype(np.float32)
    found = policies.rollout_log_probs(observations, actions)
    distribution = policies.distribution(torch.as_tensor(observations[:, 1, 3:4]))
    expected = policies.log_prob(distribution, torch.as_tensor(actions[:, 1, 3:4]))[:, 0]
    assert found[:, 1, 3] == pytest.approx(expected.detach().numpy(), abs=1e-5)
