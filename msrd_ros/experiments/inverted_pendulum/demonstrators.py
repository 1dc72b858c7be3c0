"""Twenty ways to balance a pole: training them, choosing them, keeping them as data files.

The recipe that made a file stands in its header, and ``make_demonstrators`` run with it makes the file again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.experiments.inverted_pendulum.environment import (
    has_fallen,
    pendulum_layout,
    task_reward,
)
from msrd_ros.experiments.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.experiments.inverted_pendulum.truths import (
    DivergenceTruth,
    KnownPreferences,
    PreferenceReward,
    extrinsic,
    pendulum_features,
)
from msrd_ros.experiments.virtual_studies.demonstrator_files import read_demonstrators, write_demonstrators
from msrd_ros.experiments.virtual_studies.posterior_truth import PosteriorTruth
from msrd_ros.experiments.virtual_studies.task import StrategyTruth
from msrd_ros.facts.errors import UserError
from msrd_ros.learning.diayn import DiaynReward
from msrd_ros.learning.kl_encouraged import KLEncouragedReward
from msrd_ros.learning.networks import BatchedMLP
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.reinforcement import PolicyTraining, RewardSource
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig

STRATEGIES = 20
_FEWEST = 8
_POLICY_HIDDEN = (32, 32)
_POSTERIOR_HIDDEN = (64, 64)


class Kind(StrEnum):
    """Where the heterogeneity comes from."""

    DIAYN = "diayn"
    KL_ENCOURAGED = "kl_encouraged"
    KNOWN_PREFERENCE = "known_preference"


@dataclass(frozen=True)
class Recipe:
    """How a set of demonstrators is made.

    Attributes
    ----------
    kind
        Source of heterogeneity.
    seed
        Everything random follows from it.
    candidates
        Strategies trained, of which 20 are kept.
    weight
        Weight of the diversity or preference reward beside the task reward.
    bound
        KL-encouraged: largest divergence of a pair that counts, in nats.
    start_sweeps
        Updates of one policy on the task and staying in the middle, from which all candidates then start;
        0: from random weights.
    short_sweeps, short_steps, long_sweeps
        TRPO updates on episodes of that many steps, then updates on the full 1,000.
    blur
        DIAYN: resolution at which the posterior sees states, in the features' scale (0.05 is 2.5 cm).
    episodes
        Short episodes per strategy and sweep.
    kl
        Trust region.
    """

    kind: Kind = Kind.DIAYN
    seed: int = 0
    candidates: int = 25
    weight: float = 0.1
    bound: float = 10.0
    start_sweeps: int = 0
    short_sweeps: int = 220
    short_steps: int = 200
    long_sweeps: int = 30
    blur: float = 0.05
    episodes: int = 10
    kl: float = 0.03


@dataclass(frozen=True)
class Demonstrators:
    """Policies that solve the task, each in its own way, and what each of them truly prefers.

    Attributes
    ----------
    recipe
        How they were made.
    policies
        20 Gaussian policies.
    truth
        Their true strategy rewards.
    report
        Per kept strategy: task return a step, share of episodes with a fall, distinctness.
    """

    recipe: Recipe
    policies: GaussianPolicies
    truth: StrategyTruth
    report: dict[str, Any]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the strategies."""
        return tuple(f"strategy {index + 1}" for index in range(self.policies.strategies))

    def demonstrate(self, count: int, seed: int, horizon: int = 1000) -> Demonstrations:
        """Play `count` episodes of each strategy, stochastically, as maximum-entropy experts do."""
        collector = PendulumCollector(horizon)
        played = collector.collect(self.policies, count, np.random.default_rng(seed))
        return Demonstrations(played.observations, played.actions, pendulum_layout(self.labels))


def make_demonstrators(recipe: Recipe, progress: Callable[[str], None] = lambda line: None) -> Demonstrators:
    """Train candidates and keep up to 20 of them.

    The rule: a candidate must stay up in every one of 10 episodes of 1,000 steps and lose no more than
    0.05 rad a step on average; of those, the 20 most distinct are kept (distinctness: how often a fresh
    classifier of states, fitted on other episodes, recognises it). DIAYN has to give 20; of the 20 known
    preferences and of the KL-encouraged candidates those that pass are kept, at least 8.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    count = STRATEGIES if recipe.kind is Kind.KNOWN_PREFERENCE else recipe.candidates
    policies = _fresh_policies(count, generator)
    if recipe.start_sweeps:
        start = _balancing_policy(recipe).flat()
        start[:, -1] = float(np.log(0.3))  # room to explore again
        policies.set_flat(start.expand(count, -1))
    source: RewardSource
    if recipe.kind is Kind.DIAYN:
        source = DiaynReward(
            count,
            pendulum_features(),
            _POSTERIOR_HIDDEN,
            extrinsic,
            recipe.weight,
            generator,
            blur=recipe.blur,
        )
    elif recipe.kind is Kind.KL_ENCOURAGED:
        source = KLEncouragedReward(extrinsic, recipe.weight / (count - 1), recipe.bound)
    else:
        source = PreferenceReward(KnownPreferences.twenty(), recipe.weight)
    training = _training(policies, source, recipe.episodes, recipe)
    for sweep in range(recipe.short_sweeps + recipe.long_sweeps):
        if sweep == recipe.short_sweeps:
            training.collector = PendulumCollector(1000)
            training.episodes = 3
        metrics = training.sweep()
        if sweep % 20 == 19:
            progress(f"demonstrators: sweep {sweep + 1}, reward {metrics['reward']:.3f}")
    if isinstance(source, DiaynReward):
        _settle_posterior(source, policies, recipe.seed)
    kept, report = _choose(policies, recipe)
    chosen = _subset(policies, kept)
    if isinstance(source, DiaynReward):
        return Demonstrators(
            recipe, chosen, PosteriorTruth(source.posterior, pendulum_features(), kept), report
        )
    return Demonstrators(recipe, chosen, _other_truth(recipe, chosen, kept), report)


def _balancing_policy(recipe: Recipe) -> GaussianPolicies:
    """One policy that has learned the task and nothing else."""
    policy = _fresh_policies(1, torch.Generator().manual_seed(recipe.seed + 10))
    task = PreferenceReward(KnownPreferences((0,), (0.0,), (0.4,), (False,), (math.inf,)), 0.1)
    training = _training(policy, task, 4 * recipe.episodes, recipe)
    for _ in range(recipe.start_sweeps):
        training.sweep()
    return policy


def _training(
    policies: GaussianPolicies, source: RewardSource, episodes: int, recipe: Recipe
) -> PolicyTraining:
    return PolicyTraining(
        policies,
        pendulum_features(),
        source,
        PendulumCollector(recipe.short_steps),
        episodes,
        TrustRegionConfig(kl=recipe.kl),
        ValueConfig(hidden=(32, 32), steps=10, sees_time=False, bootstrap=True),
        0.99,
        0.97,
        recipe.seed,
    )


def _fresh_policies(count: int, generator: torch.Generator) -> GaussianPolicies:
    """Std 0.5 at first, never below 0.1 or above 1: without the cap it runs away while actions clip."""
    bounds = (float(np.log(0.5)), float(np.log(0.1)), 0.0)
    return GaussianPolicies(count, pendulum_features(), 1, _POLICY_HIDDEN, *bounds, generator)


def _settle_posterior(source: DiaynReward, policies: GaussianPolicies, seed: int) -> None:
    """Bring q to rest on the finished policies, so that the truth is theirs as they are."""
    played = PendulumCollector(1000).collect(policies, 4, np.random.default_rng([seed, 2]))
    states = torch.as_tensor(played.observations[:, :, 1:]).flatten(1, 2)
    for _ in range(40):
        source.fit(states)


def _choose(policies: GaussianPolicies, recipe: Recipe) -> tuple[tuple[int, ...], dict[str, Any]]:
    played = PendulumCollector(1000).collect(policies, 10, np.random.default_rng([recipe.seed, 3]))
    falls = has_fallen(played.observations).mean(axis=1)
    returns = task_reward(played.observations[:, :, 1:]).mean(axis=(1, 2))
    able = (falls == 0.0) & (returns > -0.05)
    generator = torch.Generator().manual_seed(recipe.seed + 1)
    classifier = DiaynReward(
        policies.strategies,
        pendulum_features(),
        _POSTERIOR_HIDDEN,
        extrinsic,
        1.0,
        generator,
        blur=recipe.blur,
    )
    states = torch.as_tensor(played.observations[:, :, 1:])
    for _ in range(80):
        classifier.fit(states[:, :5].flatten(1, 2))
    recognised = np.zeros(policies.strategies)
    for index in range(policies.strategies):
        found = classifier.log_posterior(states[index, 5:].reshape(-1, 4)).argmax(dim=0)
        recognised[index] = float((found == index).float().mean())
    order = sorted(range(policies.strategies), key=lambda i: (not able[i], -recognised[i]))
    needed = STRATEGIES if recipe.kind is Kind.DIAYN else _FEWEST
    if able.sum() < needed:
        raise UserError(
            f"demonstrators: only {int(able.sum())} of {policies.strategies} candidates stay up, "
            f"{needed} are needed; train longer or more"
        )
    kept = tuple(sorted(order[: min(STRATEGIES, int(able.sum()))]))
    report = {
        "candidates": policies.strategies,
        "kept": list(kept),
        "able": int(able.sum()),
        "task_return": returns[list(kept)].tolist(),
        "recognised": recognised[list(kept)].tolist(),
        "cart_position_mean": played.observations[list(kept), :, 500:, 0].mean(axis=(1, 2)).tolist(),
        "cart_position_sd": played.observations[list(kept), :, 500:, 0].std(axis=(1, 2)).tolist(),
    }
    return kept, report


def _subset(policies: GaussianPolicies, kept: tuple[int, ...]) -> GaussianPolicies:
    chosen = _fresh_policies(len(kept), torch.Generator().manual_seed(0))
    chosen.set_flat(policies.flat()[list(kept)])
    return chosen


def _other_truth(recipe: Recipe, policies: GaussianPolicies, kept: tuple[int, ...]) -> StrategyTruth:
    if recipe.kind is Kind.KL_ENCOURAGED:
        return DivergenceTruth(policies, recipe.bound)
    return KnownPreferences.twenty().subset(kept)


def save_demonstrators(path: Path, demonstrators: Demonstrators) -> None:
    """Write policies, truth, recipe and report as one file."""
    tensors = {"policies": demonstrators.policies.flat()}
    if isinstance(demonstrators.truth, PosteriorTruth):
        tensors["posterior"] = demonstrators.truth.posterior.flat()
    write_demonstrators(path, demonstrators.recipe, demonstrators.report, tensors)


def load_demonstrators(path: Path) -> Demonstrators:
    """Read a file of `save_demonstrators`.

    Raises
    ------
    UserError
        If it is missing or damaged.
    """
    return read_demonstrators(path, _restored)


def _restored(
    kept_recipe: dict[str, Any], report: dict[str, Any], tensors: dict[str, Tensor]
) -> Demonstrators:
    recipe = Recipe(**{**kept_recipe, "kind": Kind(kept_recipe["kind"])})
    generator = torch.Generator().manual_seed(0)
    policies = _fresh_policies(tensors["policies"].shape[0], generator)
    policies.set_flat(tensors["policies"])
    kept = tuple(report["kept"])
    if recipe.kind is not Kind.DIAYN:
        return Demonstrators(recipe, policies, _other_truth(recipe, policies, kept), report)
    posterior = BatchedMLP(1, (4, *_POSTERIOR_HIDDEN, recipe.candidates), generator)
    posterior.set_flat(tensors["posterior"])
    return Demonstrators(recipe, policies, PosteriorTruth(posterior, pendulum_features(), kept), report)


def cached_demonstrators(kind: Kind) -> Demonstrators:
    """The set that comes with the package."""
    folder = files("msrd_ros.experiments.inverted_pendulum") / "data"
    return load_demonstrators(Path(str(folder / f"{kind.value}.safetensors")))
