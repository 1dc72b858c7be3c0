"""Two ways of getting ahead: what hop and crawl are, and how they are kept as data files.

The recipe that made a file stands in its header, and
``python -m msrd_ros.studies.hopper.demonstrator_training PAIR`` makes the file again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.hopper.environment import FEATURE_NAMES, Hopper, hopper_layout
from msrd_ros.studies.shared.demonstrator_files import read_demonstrators, write_demonstrators
from msrd_ros.studies.shared.divergence_truth import DivergenceTruth
from msrd_ros.studies.shared.posterior_truth import PosteriorTruth

GaitTruth = PosteriorTruth | DivergenceTruth
"""What gaits can truly prefer: to be told apart by their states, or to differ in what they do."""
LABELS = ("hop", "crawl")
PAIRS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
"""Evaluated; recipes' seeds 10 to 17 in order. Those of 1 to 9 are used up: settings were chosen on them."""
TUNING_PAIR = "tuning"
KL_ENCOURAGED_PAIR = "kl_encouraged"
OTHERS = 24
"""Gaits kept that nobody demonstrates, spread evenly over strategies and training time."""
FEATURE_SCALES = (0.5, 0.5, 1.0, 1.0, 0.5, 2.0, 1.5, 3.0, 5.0, 5.0, 5.0)
"""Metres, radians and their rates at the size they move."""
POLICY_HIDDEN = (64, 64)
POSTERIOR_HIDDEN = (64, 64)


def hopper_features() -> Features:
    """All columns but the true reward, at a fixed scale."""
    width = len(FEATURE_NAMES)
    return Features(tuple(range(1, width + 1)), (0.0,) * width, FEATURE_SCALES)


@dataclass(frozen=True)
class Recipe:
    """How a pair of demonstrators and the other gaits are made.

    Attributes
    ----------
    seed
        Everything random follows from it.
    upright, free
        Strategies that are held to stay healthy while they train, and strategies that may do anything.
    weight
        Weight of the diversity reward beside the speed.
    divergence_bound
        KL-encouraged: largest divergence of a pair that counts, in nats; the reward is the mean over the
        others. None: DIAYN.
    floor
        DIAYN: lower bound of the pseudo-reward in nats, in training and so in the truth.
    healthy_bonus, fall_cost
        What the upright ones get for a healthy step, and pay for a fall, in m/s; they then start again.
    speed_cap
        Speed from which on the upright ones gain nothing more, in m/s: without it they take runs that end in
        a fall, again and again.
    stages
        (iterations, episodes, steps): TRPO updates on so many episodes per strategy of so many steps.
    snapshot_every
        Iterations between two copies of the policies, which are candidates as well.
    kl
        Trust region.
    std
        Standard deviation at the start of training; it never falls below 0.1.
    play_std
        Largest standard deviation with which candidates are played once trained.
    """

    seed: int = 0
    upright: int = 2
    free: int = 3
    weight: float = 0.2
    divergence_bound: float | None = None
    floor: float = -5.0
    healthy_bonus: float = 1.0
    fall_cost: float = 100.0
    speed_cap: float = 1.6
    stages: tuple[tuple[int, int, int], ...] = ((90, 4, 500), (40, 2, 1000))
    snapshot_every: int = 10
    kl: float = 0.02
    std: float = 0.6
    play_std: float = 0.15

    @property
    def strategies(self) -> int:
        """Strategies trained."""
        return self.upright + self.free


def extrinsic(states: Tensor) -> Tensor:
    """True task reward of states ``[..., 12]``."""
    return states[..., 0]


@dataclass(frozen=True)
class Demonstrators:
    """A hop and a crawl of near-equal speed, what each truly prefers, and the gaits nobody demonstrates.

    Attributes
    ----------
    recipe
        How they were made.
    policies
        Hop and crawl.
    others
        `OTHERS` of the other candidates, for judging rewards on gaits that no method ever sees.
    truth
        What hop and crawl truly prefer.
    report
        What was chosen, and how fast and how high every candidate goes.
    """

    recipe: Recipe
    policies: GaussianPolicies
    others: GaussianPolicies
    truth: GaitTruth
    report: dict[str, Any]
    _played: dict[tuple[int, int, int], Demonstrations] = field(default_factory=dict, repr=False)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the strategies."""
        return LABELS

    def demonstrate(self, count: int, seed: int, horizon: int = 1000) -> Demonstrations:
        """Play `count` episodes of each strategy, stochastically, as maximum-entropy experts do.

        All methods ask for the same ones; the latest are kept, for playing them takes seconds.
        """
        if (count, seed, horizon) in self._played:
            return self._played[count, seed, horizon]
        collector = BatchedCollector(Hopper(horizon))
        played = collector.collect(self.policies, count, np.random.default_rng(seed))
        demonstrations = Demonstrations(played.observations, played.actions, hopper_layout(LABELS))
        self._played.clear()
        self._played[count, seed, horizon] = demonstrations
        return demonstrations


def gait_policies(
    count: int, generator: torch.Generator, std: float, std_max: float = 1.0
) -> GaussianPolicies:
    """Fresh policies for a gait each; their standard deviation never falls below 0.1."""
    bounds = (float(np.log(std)), float(np.log(0.1)), float(np.log(std_max)))
    return GaussianPolicies(count, hopper_features(), 3, POLICY_HIDDEN, *bounds, generator)


def trained_policies(flat: Tensor, recipe: Recipe) -> GaussianPolicies:
    """Candidates ``flat [C, P]`` as they explored in training."""
    return _restored_policies(flat, recipe.std, 1.0)


def played_policies(flat: Tensor, recipe: Recipe) -> GaussianPolicies:
    """Candidates ``flat [C, P]`` as they are played once trained."""
    return _restored_policies(flat, recipe.play_std, recipe.play_std)


def _restored_policies(flat: Tensor, std: float, std_max: float) -> GaussianPolicies:
    policies = gait_policies(flat.shape[0], torch.Generator().manual_seed(0), std, std_max)
    policies.set_flat(flat)
    return policies


def save_demonstrators(path: Path, demonstrators: Demonstrators) -> None:
    """Write policies, posterior, recipe and report as one file."""
    tensors = {"policies": demonstrators.policies.flat(), "others": demonstrators.others.flat()}
    truth = demonstrators.truth
    if isinstance(truth, DivergenceTruth):
        tensors["candidates"] = truth.candidates.flat()
    else:
        tensors["posterior"] = truth.posterior.flat()
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
    recipe = Recipe(**{**kept_recipe, "stages": tuple(tuple(stage) for stage in kept_recipe["stages"])})
    policies, others = (played_policies(tensors[name], recipe) for name in ("policies", "others"))
    return Demonstrators(recipe, policies, others, _truth(recipe, report, tensors), report)


def _truth(recipe: Recipe, report: dict[str, Any], tensors: dict[str, Tensor]) -> GaitTruth:
    kept = tuple(report["strategies"])
    if recipe.divergence_bound is not None:
        return DivergenceTruth(trained_policies(tensors["candidates"], recipe), recipe.divergence_bound, kept)
    sizes = (len(FEATURE_NAMES), *POSTERIOR_HIDDEN, recipe.strategies)
    posterior = BatchedMLP(1, sizes, torch.Generator().manual_seed(0))
    posterior.set_flat(tensors["posterior"])
    return PosteriorTruth(posterior, hopper_features(), kept, recipe.floor)


def pair_path(pair: str) -> Path:
    """Where the package keeps a pair."""
    return Path(str(files("msrd_ros.studies.hopper") / "data" / f"{pair}.safetensors"))


def cached_demonstrators(pair: str) -> Demonstrators:
    """One of `PAIRS`, the KL-encouraged pair, or the pair that everything was tuned on."""
    return load_demonstrators(pair_path(pair))
