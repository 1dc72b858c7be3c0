"""Two ways of getting ahead: training hop and crawl, choosing them, keeping them as data files.

The recipe that made a file stands in its header, and ``python -m msrd_ros.experiments.hopper.demonstrators``
makes the files again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.experiments.hopper.environment import (
    FEATURE_NAMES,
    Hopper,
    hopper_layout,
    is_healthy,
    mean_speed,
)
from msrd_ros.experiments.virtual_studies.demonstrator_files import read_demonstrators, write_demonstrators
from msrd_ros.experiments.virtual_studies.posterior_truth import PosteriorTruth
from msrd_ros.facts.errors import UserError
from msrd_ros.learning.diayn import DiaynReward
from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig

LABELS = ("hop", "crawl")
PAIRS = ("first", "second")
TUNING_PAIR = "tuning"
SEEDS = {"first": 1, "second": 2, "tuning": 0}
"""Recipe seeds of the cached pairs."""
OTHERS = 24
"""Gaits kept that nobody demonstrates, spread evenly over strategies and training time."""
FEATURE_SCALES = (0.5, 0.5, 1.0, 1.0, 0.5, 2.0, 1.5, 3.0, 5.0, 5.0, 5.0)
"""Metres, radians and their rates at the size they move."""
_POLICY_HIDDEN = (64, 64)
_POSTERIOR_HIDDEN = (64, 64)


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
        Weight of DIAYN's pseudo-reward beside the speed.
    floor
        Lower bound of the pseudo-reward in nats, in training and so in the truth.
    healthy_bonus, fall_cost
        What the upright ones get for a healthy step, and pay for a fall, in m/s; they then start again.
    speed_cap
        Speed from which on the upright ones gain nothing more, in m/s: without it they take runs that end in
        a fall, again and again.
    stages
        (sweeps, episodes, steps): TRPO updates on so many episodes per strategy of so many steps.
    snapshot_every
        Sweeps between two copies of the policies, which are candidates as well.
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


class GaitReward:
    """DIAYN + speed, and for the upright ones also a bonus for being healthy and a price for a fall.

    Parameters
    ----------
    diayn
        Posterior and weight of the pseudo-reward.
    recipe
        The rest.
    """

    def __init__(self, diayn: DiaynReward, recipe: Recipe) -> None:
        self._diayn = diayn
        self._recipe = recipe

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Reward of every transition, ``[S, K, T]``; 0 for getting up again."""
        recipe = self._recipe
        reward = self._diayn.reward(rollouts, policies)
        healthy = torch.as_tensor(is_healthy(rollouts.observations[: recipe.upright]))
        before, after = healthy[:, :, :-1], healthy[:, :, 1:]
        speed = extrinsic(torch.as_tensor(rollouts.observations[: recipe.upright, :, 1:]))
        upright = reward[: recipe.upright] - (speed - recipe.speed_cap).clamp(min=0.0)
        upright = torch.where(after, upright + recipe.healthy_bonus, upright - recipe.fall_cost)
        reward[: recipe.upright] = torch.where(before, upright, torch.zeros_like(upright))
        return reward


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
    truth: PosteriorTruth
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


def make_demonstrators(recipe: Recipe, progress: Callable[[str], None] = lambda line: None) -> Demonstrators:
    """Train all strategies side by side and choose a hop and a crawl.

    The rule: every snapshot of every strategy is a candidate, judged on 4 episodes of 1,000 steps. A hop is
    of the upright strategies and healthy in at least 95 % of the states of each of them, and of 16 more (who
    falls does not get up); a crawl is of the free ones and keeps its torso below 0.6 m on average. Of the
    pairs within 5 % of each other's speed the fastest is taken, by the slower one's mean speed; if there is
    none, the pair closest in speed among those above 1 m/s.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    policies = _policies(recipe.strategies, generator, recipe.std, 1.0)
    diayn = DiaynReward(
        recipe.strategies,
        hopper_features(),
        _POSTERIOR_HIDDEN,
        extrinsic,
        recipe.weight,
        generator,
        floor=recipe.floor,
    )
    snapshots = _train(recipe, policies, diayn, progress)
    progress("demonstrators: judging the candidates")
    candidates = _policies(len(snapshots) * recipe.strategies, generator, recipe.play_std, recipe.play_std)
    candidates.set_flat(torch.cat(snapshots))
    played = BatchedCollector(Hopper()).collect(candidates, 4, np.random.default_rng([recipe.seed, 3]))
    speed = mean_speed(played.observations)
    height = played.observations[..., 1].mean(axis=(1, 2))
    upright = np.arange(len(speed)) % recipe.strategies < recipe.upright
    hops = upright & _stays_healthy(played.observations)
    hops[hops] = _stays_healthy(_play_again(candidates.flat()[hops], recipe))
    hop, crawl = choose_pair(speed.mean(axis=1), hops, (height < 0.6) & ~upright)
    strategies = (hop % recipe.strategies, crawl % recipe.strategies)
    # The truth is that of the demonstrators as they are: q comes to rest on the chosen two and, for the
    # strategies that were not chosen, on their last snapshots.
    settled = list(range(len(speed) - recipe.strategies, len(speed)))
    settled[strategies[0]], settled[strategies[1]] = hop, crawl
    states = torch.as_tensor(played.observations[settled][:, :, 1:]).flatten(1, 2)
    for _ in range(100):
        diayn.fit(states)
    rest = [index for index in range(len(speed)) if index not in (hop, crawl)]
    rest = [
        rest[place] for place in np.linspace(0, len(rest) - 1, min(OTHERS, len(rest))).round().astype(int)
    ]
    report = {
        "candidates": len(speed),
        "chosen": [hop, crawl],
        "strategies": list(strategies),
        "speed": speed[[hop, crawl]].mean(axis=1).tolist(),
        "speed_sd": speed[[hop, crawl]].std(axis=1).tolist(),
        "height": height[[hop, crawl]].tolist(),
        "other_speeds": speed[rest].mean(axis=1).tolist(),
        "other_heights": height[rest].tolist(),
    }
    flat = candidates.flat()
    return Demonstrators(
        recipe,
        _taken(flat[[hop, crawl]], recipe),
        _taken(flat[rest], recipe),
        PosteriorTruth(diayn.posterior, hopper_features(), strategies, recipe.floor),
        report,
    )


def _stays_healthy(observations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether every one of the episodes ``[C, K, T+1, 12]`` is healthy almost throughout, ``[C]``."""
    return np.asarray((is_healthy(observations).mean(axis=2) >= 0.95).all(axis=1))


def _play_again(flat: Tensor, recipe: Recipe) -> NDArray[np.float32]:
    """16 more episodes of each of the policies ``flat [C, P]``."""
    collector = BatchedCollector(Hopper())
    return collector.collect(_taken(flat, recipe), 16, np.random.default_rng([recipe.seed, 4])).observations


def choose_pair(
    speed: NDArray[np.floating], hops: NDArray[np.bool_], crawls: NDArray[np.bool_]
) -> tuple[int, int]:
    """The rule of `make_demonstrators` on the candidates' mean speeds ``[C]``: indices of hop and crawl.

    Raises
    ------
    UserError
        If there is no hop or no crawl faster than 1 m/s.
    """
    fast = speed > 1.0
    pairs = [(int(h), int(c)) for h, c in product(np.flatnonzero(hops & fast), np.flatnonzero(crawls & fast))]
    if not pairs:
        raise UserError(
            f"demonstrators: {int((hops & fast).sum())} hops and {int((crawls & fast).sum())} crawls are "
            "faster than 1 m/s, one of each is needed; train longer, or with another seed"
        )

    def gap(pair: tuple[int, int]) -> float:
        first, second = speed[pair[0]], speed[pair[1]]
        return float(abs(first - second) / max(first, second))

    close = [pair for pair in pairs if gap(pair) <= 0.05]
    if close:
        return max(close, key=lambda pair: min(speed[pair[0]], speed[pair[1]]))
    return min(pairs, key=gap)


def _train(
    recipe: Recipe, policies: GaussianPolicies, diayn: DiaynReward, progress: Callable[[str], None]
) -> list[Tensor]:
    """Run all stages; snapshots of the policies, ``[S, P]`` each."""
    gets_up = (True,) * recipe.upright + (False,) * recipe.free
    training = PolicyTraining(
        policies,
        hopper_features(),
        GaitReward(diayn, recipe),
        BatchedCollector(Hopper(1)),
        1,
        TrustRegionConfig(kl=recipe.kl, fisher_fraction=0.3),
        ValueConfig(hidden=(64, 64), steps=40, sees_time=False, bootstrap=True),
        0.99,
        0.97,
        recipe.seed,
    )
    snapshots: list[Tensor] = []
    done = 0
    for sweeps, episodes, steps in recipe.stages:
        training.collector, training.episodes = BatchedCollector(Hopper(steps, gets_up=gets_up)), episodes
        for _ in range(sweeps):
            metrics = training.sweep()
            done += 1
            if done % 20 == 0:
                progress(f"demonstrators: sweep {done}, reward {metrics['reward']:.2f}")
            if done % recipe.snapshot_every == 0:
                snapshots.append(policies.flat())
    return snapshots


def _policies(count: int, generator: torch.Generator, std: float, std_max: float) -> GaussianPolicies:
    bounds = (float(np.log(std)), float(np.log(0.1)), float(np.log(std_max)))
    return GaussianPolicies(count, hopper_features(), 3, _POLICY_HIDDEN, *bounds, generator)


def _taken(flat: Tensor, recipe: Recipe) -> GaussianPolicies:
    taken = _policies(flat.shape[0], torch.Generator().manual_seed(0), recipe.play_std, recipe.play_std)
    taken.set_flat(flat)
    return taken


def save_demonstrators(path: Path, demonstrators: Demonstrators) -> None:
    """Write policies, posterior, recipe and report as one file."""
    tensors = {
        "policies": demonstrators.policies.flat(),
        "others": demonstrators.others.flat(),
        "posterior": demonstrators.truth.posterior.flat(),
    }
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
    sizes = (len(FEATURE_NAMES), *_POSTERIOR_HIDDEN, recipe.strategies)
    posterior = BatchedMLP(1, sizes, torch.Generator().manual_seed(0))
    posterior.set_flat(tensors["posterior"])
    policies, others = (_taken(tensors[name], recipe) for name in ("policies", "others"))
    truth = PosteriorTruth(posterior, hopper_features(), tuple(report["strategies"]), recipe.floor)
    return Demonstrators(recipe, policies, others, truth, report)


def pair_path(pair: str) -> Path:
    """Where the package keeps a pair."""
    return Path(str(files("msrd_ros.experiments.hopper") / "data" / f"{pair}.safetensors"))


def cached_demonstrators(pair: str) -> Demonstrators:
    """One of `PAIRS`, or the pair that everything was tuned on."""
    return load_demonstrators(pair_path(pair))


def main() -> None:
    """Make the cached files again, all or those named on the command line."""
    torch.set_num_threads(1)
    for pair in sys.argv[1:] or [*PAIRS, TUNING_PAIR]:
        made = make_demonstrators(Recipe(seed=SEEDS[pair]), lambda line: print(line, flush=True))
        print(json.dumps(made.report), flush=True)
        save_demonstrators(pair_path(pair), made)


if __name__ == "__main__":
    main()
