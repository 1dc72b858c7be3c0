"""The discriminator and its losses, one function for each equation of the paper.

D_i(s, a) = exp(f_i) / (exp(f_i) + pi_i(a|s)) has the logit f_i - log pi_i, so that
log D = log sigmoid(logit) = -softplus(-logit) and log(1 - D) = -softplus(logit).
Losses are minimised: they are the negative of what the paper maximises. Every function works on all
strategies at once and returns one value per strategy, ``[S]``.
"""

from __future__ import annotations

from enum import StrEnum

import torch
from torch import Tensor
from torch.nn.functional import softplus


class Penalty(StrEnum):
    """The regulariser's measure of a strategy reward."""

    SQUARE = "square"
    """E[S_i^2], as the authors' code has it."""
    NORM = "norm"
    """E[||S_i||_2] = E[|S_i|], as the paper prints it."""


def discriminator_logit(combined: Tensor, log_prob: Tensor) -> Tensor:
    """Logit of D_i: ``f_i(s, a) - log pi_i(a|s)`` (paper, Equation 2)."""
    return combined - log_prob


def airl_loss(demonstration_logit: Tensor, generated_logit: Tensor) -> Tensor:
    """Cross entropy of the discriminator (paper, Equation 3 with its slip set right), ``[S]``.

    ``-E_demo[log D] - E_gen[log(1 - D)]``; the print has ``1 - log D`` once, and ``log(1 - D)`` in
    Equation 6.
    """
    return softplus(-demonstration_logit).mean(dim=1) + softplus(generated_logit).mean(dim=1)


def strategy_regulariser(strategy: Tensor, penalty: Penalty, above: float = 1.0) -> Tensor:
    """``E ||S_i||`` of Equation 7 (of R_i - R0 in Equation 5), ``[S]``.

    Parameters
    ----------
    above
        Factor on positive values. With squares, the R0 that is cheapest in a state is an expectile of the
        R_i there: their mean for 1 (the paper), towards their upper envelope for more.
    """
    size = strategy.square() if penalty is Penalty.SQUARE else strategy.abs()
    if above != 1.0:
        size = torch.where(strategy > 0.0, above * size, size)
    return size.mean(dim=1)


def distillation_loss(
    demonstration_logit: Tensor,
    generated_logit: Tensor,
    strategy: Tensor,
    weight: Tensor | float,
    penalty: Penalty,
    above: float = 1.0,
) -> Tensor:
    """MSRD's loss (paper, Equation 7; with S_i = R_i - R0, Equation 6), ``[S]``.

    Parameters
    ----------
    demonstration_logit, generated_logit
        ``[S, N]`` logits of D_i.
    strategy
        ``[S, N']`` values of S_i on the states over which the regulariser's expectation runs.
    weight
        lambda_i; the paper sets it to alpha_i.
    above
        Factor on positive values of S_i, see `strategy_regulariser`.
    """
    regulariser = strategy_regulariser(strategy, penalty, above)
    return airl_loss(demonstration_logit, generated_logit) + weight * regulariser


def cross_negative_loss(other_logit: Tensor) -> Tensor:
    """Other strategies' transitions as further negatives of D_i: ``-E[log(1 - D_i)]``, ``[S]``.

    Not in the paper: its loss shows S_i only the states of strategy i, so nothing tells S_i what the others
    look like. These are extra proposals for the partition function, in the sense of guided cost learning.
    """
    return softplus(other_logit).mean(dim=1)


def gradient_penalty(strategy: Tensor, inputs: Tensor) -> Tensor:
    """``E |grad S_i|^2`` over the scaled inputs ``[S, N, D]`` that gave ``strategy [S, N]``, ``[S]``.

    Keeps S_i from saturating away from its own states.
    """
    (gradient,) = torch.autograd.grad(strategy.sum(), inputs, create_graph=True)
    return gradient.square().sum(dim=-1).mean(dim=1)
