"""Generalised advantage estimation (Schulman et al., 2016)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def generalised_advantages(rewards: Tensor, values: Tensor, discount: float, decay: float) -> Tensor:
    """``A_t = sum_k (gamma lambda)^k delta_{t+k}`` with ``delta_t = r_t + gamma V_{t+1} - V_t``.

    Parameters
    ----------
    rewards
        ``[..., T]``.
    values
        ``[..., T + 1]``; the last is the value of the state after the last step, 0 if nothing follows.
    discount, decay
        gamma and lambda.

    Returns
    -------
    Tensor
        ``[..., T]``.
    """
    delta = rewards + discount * values[..., 1:] - values[..., :-1]
    advantages = torch.empty_like(delta)
    running = torch.zeros_like(delta[..., 0])
    for step in range(delta.shape[-1] - 1, -1, -1):
        running = delta[..., step] + discount * decay * running
        advantages[..., step] = running
    return advantages


def credit_masked_rewards(rewards: Tensor, acting_steps: int, discount: float) -> Tensor:
    """Rewards of the steps in which nothing can be decided any more, credited to the last decision.

    Parameters
    ----------
    rewards
        ``[..., T]`` of the whole horizon.
    acting_steps
        T_act; the reward k steps after the last acting step counts gamma^k at that step.

    Returns
    -------
    Tensor
        ``[..., T_act]``.
    """
    passive = rewards[..., acting_steps:]
    credited = rewards[..., :acting_steps].clone()
    if passive.shape[-1]:
        weights = discount ** np.arange(1, passive.shape[-1] + 1)
        credited[..., -1] += (passive * torch.as_tensor(weights, dtype=rewards.dtype)).sum(dim=-1)
    return credited
