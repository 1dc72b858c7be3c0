"""Ways to balance a pole: what demonstrators are, and how they are kept as data files.

The recipe that made a file stands in its header, and
``python -m msrd_ros.studies.inverted_pendulum.demonstrator_training KIND`` makes the file again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.networks import BatchedMLP
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.inverted_pendulum.environment import pendulum_layout
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.truths import KnownPreferences, pendulum_features
from msrd_ros.studies.shared.demonstrator_files import read_demonstrators, write_demonstrators
from msrd_ros.studies.shared.divergence_truth import DivergenceTruth
from msrd_ros.studies.shared.posterior_truth import PosteriorTruth
from msrd_ros.studies.shared.task import StrategyTruth

STRATEGIES = 20
POLICY_HIDDEN = (32, 32)
POSTERIOR_HIDDEN = (64, 64)


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
    start_iterations
        Updates on the task and staying in the middle, before anything else; 0: none. Known preference: of one
        policy, from which all candidates then start. KL-encouraged: of every candidate, on 300 steps, after
        stages on shorter episodes.
    short_iterations, short_steps, long_iterations
        TRPO updates on episodes of that many steps, then updates on the full 1,000.
    blur
        DIAYN: resolution at which the posterior sees states, in the features' scale (0.05 is 2.5 cm).
    episodes
        Short episodes per strategy and iteration.
    kl
        Trust region.
    """

    kind: Kind = Kind.DIAYN
    seed: int = 0
    candidates: int = 25
    weight: float = 0.1
    bound: float = 10.0
    start_iterations: int = 0
    short_iterations: int = 220
    short_steps: int = 200
    long_iterations: int = 30
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


def fresh_policies(count: int, generator: torch.Generator) -> GaussianPolicies:
    """Std 0.5 at first, never below 0.1 or above 1: without the cap it runs away while actions clip."""
    bounds = (float(np.log(0.5)), float(np.log(0.1)), 0.0)
    return GaussianPolicies(count, pendulum_features(), 1, POLICY_HIDDEN, *bounds, generator)


def save_demonstrators(path: Path, demonstrators: Demonstrators) -> None:
    """Write policies, truth, recipe and report as one file."""
    tensors = {"policies": demonstrators.policies.flat()}
    if isinstance(demonstrators.truth, PosteriorTruth):
        tensors["posterior"] = demonstrators.truth.posterior.flat()
    if isinstance(demonstrators.truth, DivergenceTruth):
        tensors["candidates"] = demonstrators.truth.candidates.flat()
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
    # Up to 0.1.0 iterations were called sweeps.
    settings = {name.replace("sweeps", "iterations"): value for name, value in kept_recipe.items()}
    recipe = Recipe(**{**settings, "kind": Kind(settings["kind"])})
    return Demonstrators(recipe, _policies(tensors["policies"]), _truth(recipe, report, tensors), report)


def _policies(flat: Tensor) -> GaussianPolicies:
    policies = fresh_policies(flat.shape[0], torch.Generator().manual_seed(0))
    policies.set_flat(flat)
    return policies


def _truth(recipe: Recipe, report: dict[str, Any], tensors: dict[str, Tensor]) -> StrategyTruth:
    kept = tuple(report["kept"])
    if recipe.kind is Kind.KNOWN_PREFERENCE:
        return KnownPreferences.twenty().subset(kept)
    if recipe.kind is Kind.KL_ENCOURAGED:
        return DivergenceTruth(_policies(tensors["candidates"]), recipe.bound, kept)
    generator = torch.Generator().manual_seed(0)
    posterior = BatchedMLP(1, (4, *POSTERIOR_HIDDEN, recipe.candidates), generator)
    posterior.set_flat(tensors["posterior"])
    return PosteriorTruth(posterior, pendulum_features(), kept)


def cached_path(kind: Kind) -> Path:
    """Where the package keeps a set."""
    folder = files("msrd_ros.studies.inverted_pendulum") / "data"
    return Path(str(folder / f"{kind.value}.safetensors"))


def cached_demonstrators(kind: Kind) -> Demonstrators:
    """The set that comes with the package."""
    return load_demonstrators(cached_path(kind))
