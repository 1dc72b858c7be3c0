"""Trajectories as the discriminator of a newcomer's reward sees them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.config import DiscriminatorConfig
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.policy import Policy
from msrd_ros.learning.reward_training import used_log_prob
from msrd_ros.learning.trajectories import Transitions


def samples_of(
    observations: NDArray[np.floating],
    actions: NDArray[np.floating],
    config: DiscriminatorConfig,
    scale: ActionScale | None = None,
    policy: Policy | None = None,
) -> Transitions:
    """Transitions ``[1, M*T]`` of trajectories.

    Parameters
    ----------
    observations, actions
        ``[M, T+1, O]`` and ``[M, T_act, A]`` in the environment's units; behind T_act nobody acts.
    config
        How log-densities are used.
    scale
        How the environment's actions follow from those that rewards know; None: they are the same.
    policy
        Under which actions have their log-density; None: it is 0.
    """
    log_prob = None
    if policy is not None:
        alone = MixedPolicy([(1.0, policy)])
        half = np.ones(actions.shape[-1]) if scale is None else scale.half
        density = alone.log_prob(observations[:, : actions.shape[1]], actions) + float(np.log(half).sum())
        log_std = torch.as_tensor(np.log(alone.deviation / half))
        log_prob = used_log_prob(torch.as_tensor(density), log_std, config).float()[None]
    units = actions if scale is None else scale.to_unit(actions)
    return Transitions.of(
        torch.as_tensor(np.asarray(observations), dtype=torch.float32)[None],
        torch.as_tensor(np.asarray(units), dtype=torch.float32)[None],
        log_prob,
    )


def whole(trajectories: Sequence[NDArray[np.floating]]) -> NDArray[np.float64]:
    """Trajectories ``[T+1, O]`` of any lengths as ``[M, T+1, O]``; short ones stay at their end."""
    longest = max(map(len, trajectories))
    padded = [
        np.concatenate([seen, np.repeat(seen[-1:], longest - len(seen), axis=0)]) for seen in trajectories
    ]
    return np.stack(padded).astype(np.float64)
