"""Natural-gradient steps against dense solves, and the promises of a trust-region step."""

from __future__ import annotations

from dataclasses import replace

import torch

from msrd_ros.learning.conjugate_gradient import conjugate_gradient
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianDistribution, GaussianPolicies
from msrd_ros.learning.trpo import TrustRegionConfig, draw_fisher_rows, natural_gradient, trust_region_step

CONFIG = TrustRegionConfig(kl=0.01, fisher_fraction=1.0, damping=0.1)


def make(strategies: int = 3) -> GaussianPolicies:
    generator = torch.Generator().manual_seed(0)
    features = Features((0, 1), (0.0, 0.0), (1.0, 1.0))
    policies = GaussianPolicies(strategies, features, 1, (4,), -0.5, -3.0, 1.0, generator)
    policies.set_flat(policies.flat() + 0.1 * torch.randn(policies.flat().shape, generator=generator))
    return policies


def batch(policies: GaussianPolicies, count: int = 300) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    states = torch.randn(policies.strategies, count, 2, generator=generator)
    mean, log_std = policies.distribution(states)
    actions = (mean + log_std.exp() * torch.randn(mean.shape, generator=generator)).detach()
    targets = torch.linspace(-1.0, 1.0, policies.strategies)[:, None]
    advantages = -(actions[..., 0] - targets).square()
    advantages = (advantages - advantages.mean(dim=1, keepdim=True)) / advantages.std(dim=1, keepdim=True)
    return states, actions, advantages


def fisher_rows(states: torch.Tensor, generator: torch.Generator | None = None) -> torch.Tensor:
    return draw_fisher_rows(states.shape[1], CONFIG, generator or torch.Generator())


def test_conjugate_gradient_solves_every_system() -> None:
    generator = torch.Generator().manual_seed(0)
    root = torch.randn(5, 12, 12, dtype=torch.float64, generator=generator)
    matrices = root @ root.transpose(1, 2) + 0.5 * torch.eye(12, dtype=torch.float64)
    right = torch.randn(5, 12, dtype=torch.float64, generator=generator)
    right[3] = 0.0
    found = conjugate_gradient(lambda v: (matrices @ v[..., None])[..., 0], right, 40, 1e-26)
    torch.testing.assert_close(found, torch.linalg.solve(matrices, right), rtol=1e-6, atol=1e-8)


def test_natural_gradient_agrees_with_a_dense_solve() -> None:
    policies = make()
    states, actions, advantages = batch(policies)
    log_prob = policies.log_prob(policies.distribution(states), actions)
    gradient = policies.flat_gradient(
        (torch.exp(log_prob - log_prob.detach()) * advantages).mean(dim=1).sum()
    )
    config = replace(CONFIG, cg_iterations=60)
    found = natural_gradient(policies, states, gradient, config)
    metric = policies.fisher_metric(states)
    count = gradient.shape[1]
    columns = [metric.product(torch.eye(count)[i].expand(3, count)) for i in range(count)]
    dense = torch.stack(columns, dim=2) + config.damping * torch.eye(count)
    direction = torch.linalg.solve(dense.double(), gradient.double())
    length = (direction * (dense.double() @ direction[..., None])[..., 0]).sum(dim=1, keepdim=True)
    expected = direction * torch.sqrt(2.0 * config.kl / length)
    torch.testing.assert_close(found.double(), expected, rtol=2e-3, atol=2e-4)


def test_policy_gradient_agrees_with_finite_differences() -> None:
    policies = make().double()
    states, actions, advantages = (part.double() for part in batch(make()))

    def objective() -> torch.Tensor:
        log_prob = policies.log_prob(policies.distribution(states), actions)
        return (log_prob * advantages).mean(dim=1)

    gradient = policies.flat_gradient(objective().sum())
    start = policies.flat()
    for parameter in range(start.shape[1]):
        bump = torch.zeros_like(start)
        bump[:, parameter] = 1e-6
        policies.set_flat(start + bump)
        above = objective().detach()
        policies.set_flat(start - bump)
        slope = (above - objective().detach()) / 2e-6
        torch.testing.assert_close(gradient[:, parameter], slope, rtol=1e-5, atol=1e-7)


def test_step_improves_within_the_trust_region() -> None:
    policies = make()
    states, actions, advantages = batch(policies)
    before = GaussianDistribution(*(part.detach().clone() for part in policies.distribution(states)))
    report = trust_region_step(policies, states, actions, advantages, CONFIG, fisher_rows(states))
    moved = policies.kl(before, policies.distribution(states))
    assert report.accepted.all()
    assert (report.improvement > 0.0).all()
    assert (moved > 0.3 * CONFIG.kl).all()
    assert (moved <= 1.02 * CONFIG.kl).all()
    torch.testing.assert_close(report.kl, moved.detach(), rtol=1e-3, atol=1e-6)


def test_strategies_do_not_disturb_each_other() -> None:
    together, alone = make(), make()
    states, actions, advantages = batch(together)
    changed = advantages.clone()
    changed[1] = -changed[1]
    trust_region_step(together, states, actions, advantages, CONFIG, fisher_rows(states))
    trust_region_step(alone, states, actions, changed, CONFIG, fisher_rows(states))
    torch.testing.assert_close(together.flat()[[0, 2]], alone.flat()[[0, 2]], rtol=1e-4, atol=1e-5)
    assert not torch.allclose(together.flat()[1], alone.flat()[1], atol=1e-3)


def test_without_advantage_the_policy_stays() -> None:
    policies = make()
    states, actions, advantages = batch(policies)
    start = policies.flat()
    report = trust_region_step(
        policies, states, actions, torch.zeros_like(advantages), CONFIG, fisher_rows(states)
    )
    assert torch.equal(policies.flat(), start)
    assert not report.accepted.any()


def test_entropy_bonus_widens_the_policy() -> None:
    policies = make()
    states, actions, advantages = batch(policies)
    config = replace(CONFIG, entropy_weight=1.0)
    before = policies.entropy(policies.distribution(states))
    trust_region_step(policies, states, actions, torch.zeros_like(advantages), config, fisher_rows(states))
    assert (policies.entropy(policies.distribution(states)) > before + 0.03).all()


def test_repeated_steps_solve_a_bandit() -> None:
    policies = make()
    config = replace(CONFIG, kl=0.05)
    generator = torch.Generator().manual_seed(2)
    targets = torch.tensor([-1.0, 0.0, 1.0])[:, None]
    for _ in range(60):
        states = torch.randn(3, 300, 2, generator=generator)
        mean, log_std = policies.distribution(states)
        actions = (mean + log_std.exp() * torch.randn(mean.shape, generator=generator)).detach()
        gain = -(actions[..., 0] - targets).square()
        gain = (gain - gain.mean(dim=1, keepdim=True)) / gain.std(dim=1, keepdim=True)
        trust_region_step(policies, states, actions, gain, config, fisher_rows(states, generator))
    mean = policies.distribution(torch.randn(3, 300, 2, generator=generator)).mean.mean(dim=1)[:, 0]
    torch.testing.assert_close(mean, targets[:, 0], atol=0.1, rtol=0.0)
