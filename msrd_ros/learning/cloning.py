"""Behaviour cloning: policies that start near the demonstrations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.replay import DemonstrationPool


@dataclass(frozen=True)
class CloningConfig:
    """Settings of the warm start.

    Attributes
    ----------
    steps, learning_rate, batch
        Adam steps, each on `batch` transitions of every strategy; the rate falls linearly to a tenth.
        0 steps leaves the policies at random.
    state_noise
        (observation name, standard deviation) pairs: Gaussian offsets injected into the states, in the
        column's own unit.
    recovery_labels
        (observation name, action name, gain) triples: an injected offset lowers that action's label by
        ``gain * offset``, so that the policy learns to come back.
    snapshots
        Steps after which a copy of the policies is played to give the discriminator bad examples.
    noise_levels
        Standard deviations with which the finished clones are played to give further bad examples, from
        nearly right to hopeless.
    restarts
        The same where an episode starts again whenever the task is lost (see `MSRD`): bad examples that do
        not only lie about where hopeless ones end.
    snapshot_episodes
        Episodes played by each snapshot or disturbed clone and strategy.
    """

    steps: int = 1500
    learning_rate: float = 3e-3
    batch: int = 256
    state_noise: tuple[tuple[str, float], ...] = ()
    recovery_labels: tuple[tuple[str, str, float], ...] = ()
    snapshots: tuple[int, ...] = ()
    noise_levels: tuple[float, ...] = ()
    restarts: tuple[float, ...] = ()
    snapshot_episodes: int = 2


def clone(
    policies: GaussianPolicies,
    demonstrations: DemonstrationPool,
    observation_names: tuple[str, ...],
    action_names: tuple[str, ...],
    config: CloningConfig,
    generator: torch.Generator,
    on_snapshot: Callable[[], None] | None = None,
) -> Tensor:
    """Fit the policies' means to the demonstrated actions by least squares.

    The standard deviations stay as they are: they are for exploration, not for the spread of the data.

    Parameters
    ----------
    on_snapshot
        Called after each of ``config.snapshots`` steps (0: before the first).

    Returns
    -------
    Tensor
        ``[S]`` mean squared error of the last batch.
    """
    noise, correction = perturbation(config, observation_names, action_names)
    chosen = demonstrations.choose(None, generator)
    parameters = list(policies.network.parameters())
    optimiser = torch.optim.Adam(parameters, lr=config.learning_rate, foreach=True)
    error = torch.zeros(policies.strategies)
    for step in range(config.steps + 1):
        if step in config.snapshots and on_snapshot is not None:
            on_snapshot()
        if step == config.steps:
            break
        optimiser.param_groups[0]["lr"] = config.learning_rate * (1.0 - 0.9 * step / config.steps)
        batch = demonstrations.sample(chosen, config.batch, generator)
        observation, label = batch.observation, batch.action
        if config.state_noise:
            offset = noise * torch.randn(observation.shape, generator=generator)
            observation, label = observation + offset, label - offset @ correction
        acting = (1.0 - batch.passive).unsqueeze(-1)
        residual = (policies.distribution(observation).mean - label).square() * acting
        loss = residual.sum(dim=-1).mean(dim=1)
        optimiser.zero_grad()
        loss.sum().backward()
        optimiser.step()
        error = loss.detach()
    return error


def perturbation(
    config: CloningConfig, observation_names: tuple[str, ...], action_names: tuple[str, ...]
) -> tuple[Tensor, Tensor]:
    """Standard deviations ``[O]`` of injected offsets, and the gain matrix ``[O, A]`` of the labels."""
    noise = torch.zeros(len(observation_names))
    correction = torch.zeros(len(observation_names), len(action_names))
    for name, deviation in config.state_noise:
        noise[_column(name, observation_names)] = deviation
    for observation, action, gain in config.recovery_labels:
        correction[_column(observation, observation_names), _column(action, action_names)] = gain
    return noise, correction


def _column(name: str, names: tuple[str, ...]) -> int:
    if name not in names:
        raise UserError(f"cloning: no column {name!r}; there are {', '.join(names)}")
    return names.index(name)
