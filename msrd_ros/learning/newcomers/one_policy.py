"""A single policy, fitted to what a newcomer did or a mixture would do, from a policy that there is."""

from __future__ import annotations

import numpy as np
import torch

from msrd_ros.learning.cloning import CloningConfig, clone
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.policy import Policy
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.trajectories import Demonstrations


def fit_policy(
    start: Policy, demonstrations: Demonstrations, config: CloningConfig, generator: torch.Generator
) -> Policy:
    """Clone demonstrations of one strategy.

    Parameters
    ----------
    start
        What it is before: where the demonstrations say nothing, it stays about like that. Sees and explores
        as the result does.
    demonstrations
        Of one strategy, actions in the environment's units; their label is the result's.
    config
        How long and how; snapshots are not played.
    """
    layout = demonstrations.layout
    features = Features(
        tuple(start.indices.tolist()), tuple(start.offset.tolist()), tuple(start.scale.tolist())
    )
    hidden = tuple(weight.shape[1] for weight in start.weights[:-1])
    policies = GaussianPolicies(1, features, len(layout.action_names), hidden, 0.0, -20.0, 5.0, generator)
    network = policies.network
    with torch.no_grad():
        for layer, (weight, bias) in enumerate(zip(start.weights, start.biases, strict=True)):
            network.weights[layer].copy_(torch.as_tensor(weight)[None])
            network.biases[layer].copy_(torch.as_tensor(bias)[None, None])
    clone(
        policies,
        DemonstrationPool(demonstrations),
        layout.observation_names,
        layout.action_names,
        config,
        generator,
    )
    return Policy(
        layout.labels[0],
        tuple(weight.detach().numpy()[0].copy() for weight in network.weights),
        tuple(bias.detach().numpy()[0, 0].copy() for bias in network.biases),
        np.array(start.log_std),
        start.indices,
        start.offset,
        start.scale,
    )
