"""Trust-region policy optimisation (Schulman et al., 2015) with entropy bonus, all strategies at once.

Each strategy has its own gradient, its own trust region and its own line search; only the tensor
operations are shared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from msrd_ros.learning.conjugate_gradient import conjugate_gradient
from msrd_ros.learning.policies import Policies


@dataclass(frozen=True)
class TrustRegionConfig:
    """Settings of one policy update.

    Attributes
    ----------
    kl, kl_end
        Largest mean KL(old || new) of one update, in nats; it falls linearly to the share `kl_end` of it over
        the planned iterations. Steps that stay long wander about once the reward has nothing left to say.
    entropy_weight
        Weight of the policy's entropy in the objective (the paper's entropy bonus).
    cg_iterations, damping
        Conjugate-gradient steps, and the multiple of the identity added to the Fisher matrix.
    fisher_fraction
        Share of the samples used for Fisher products.
    backtracks, backtrack_factor
        Line search: how often the step is shortened, and by which factor.
    """

    kl: float = 0.01
    kl_end: float = 1.0
    entropy_weight: float = 0.0
    cg_iterations: int = 10
    damping: float = 0.1
    fisher_fraction: float = 0.2
    backtracks: int = 8
    backtrack_factor: float = 0.6


@dataclass(frozen=True)
class TrustRegionReport:
    """What an update did, one value per strategy ``[S]``: KL moved, gain of the objective, accepted."""

    kl: Tensor
    improvement: Tensor
    accepted: Tensor


def trust_region_step(
    policies: Policies,
    observations: Tensor,
    actions: Tensor,
    advantages: Tensor,
    config: TrustRegionConfig,
    fisher_rows: Tensor,
) -> TrustRegionReport:
    """Update `policies` in place (Algorithm 1, line 10).

    Maximises ``E[pi(a|s) / pi_old(a|s) A] + w H(pi)`` to first order within KL(old || new) <= kl:
    ``theta += sqrt(2 kl / g^T F^-1 g) F^-1 g``, shortened until the objective itself rises and the
    measured KL keeps to its bound; otherwise the strategy keeps its old parameters.

    Parameters
    ----------
    observations, actions, advantages
        ``[S, N, O]``, ``[S, N, A]``, ``[S, N]`` of the current policies' own rollouts; advantages are
        used as they are (standardise them first).
    fisher_rows
        Which samples the Fisher products take, of `draw_fisher_rows`.
    """
    old = policies.distribution(observations)
    old_log_prob = policies.log_prob(old, actions)
    objective = _surrogate(policies, old, old_log_prob, old_log_prob.detach(), advantages, config)
    gradient = policies.flat_gradient(objective.sum())
    before = objective.detach()
    old = type(old)(*(part.detach().clone() for part in old))
    old_log_prob = old_log_prob.detach()

    step = natural_gradient(policies, observations[:, fisher_rows], gradient, config)
    start = policies.flat()
    scale = torch.ones_like(before)
    accepted = torch.zeros_like(before, dtype=torch.bool)
    kl, gain = torch.zeros_like(before), torch.zeros_like(before)
    with torch.no_grad():
        for _ in range(config.backtracks):
            policies.set_flat(start + scale[:, None] * step)
            new = policies.distribution(observations)
            log_prob = policies.log_prob(new, actions)
            new_gain = _surrogate(policies, new, log_prob, old_log_prob, advantages, config) - before
            new_kl = policies.kl(old, new)
            good = (new_gain > 0.0) & (new_kl <= 1.01 * config.kl) & ~accepted
            kl, gain = torch.where(good, new_kl, kl), torch.where(good, new_gain, gain)
            accepted |= good
            if bool(accepted.all()):
                break
            scale = torch.where(accepted, scale, scale * config.backtrack_factor)
        policies.set_flat(start + torch.where(accepted, scale, torch.zeros_like(scale))[:, None] * step)
    return TrustRegionReport(kl, gain, accepted)


def draw_fisher_rows(samples: int, config: TrustRegionConfig, generator: torch.Generator) -> Tensor:
    """Rows, ``[F]``, of so many samples for the Fisher products."""
    if config.fisher_fraction >= 1.0:
        return torch.arange(samples)
    count = max(1, round(config.fisher_fraction * samples))
    return torch.randperm(samples, generator=generator)[:count]


def natural_gradient(
    policies: Policies, observations: Tensor, gradient: Tensor, config: TrustRegionConfig
) -> Tensor:
    """The step ``sqrt(2 kl / x^T F x) x`` with ``(F + damping I) x = gradient``, ``[S, P]``.

    The Fisher matrix F is averaged over ``observations [S, F, O]``.
    """
    metric = policies.fisher_metric(observations)

    def damped(vector: Tensor) -> Tensor:
        return metric.product(vector) + config.damping * vector

    direction = conjugate_gradient(damped, gradient, config.cg_iterations)
    length = (direction * damped(direction)).sum(dim=1, keepdim=True)
    return direction * torch.sqrt(2.0 * config.kl / length.clamp(min=1e-20))


def _surrogate(
    policies: Policies,
    distribution: Any,
    log_prob: Tensor,
    old_log_prob: Tensor,
    advantages: Tensor,
    config: TrustRegionConfig,
) -> Tensor:
    """Importance-weighted advantage plus entropy bonus, ``[S]``."""
    expected = (torch.exp(log_prob - old_log_prob) * advantages).mean(dim=1)
    return expected + config.entropy_weight * policies.entropy(distribution)
