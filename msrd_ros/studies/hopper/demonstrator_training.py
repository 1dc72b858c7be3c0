"""Training gaits and choosing a hop and a crawl among them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.diayn import DiaynReward
from msrd_ros.learning.harness import iterations
from msrd_ros.learning.kl_encouraged import KLEncouragedReward
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.reinforcement import PolicyTraining, RewardSource
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.hopper.demonstrators import (
    KL_ENCOURAGED_PAIR,
    OTHERS,
    PAIRS,
    POSTERIOR_HIDDEN,
    TUNING_PAIR,
    Demonstrators,
    GaitTruth,
    Recipe,
    cached_demonstrators,
    extrinsic,
    gait_policies,
    hopper_features,
    pair_path,
    played_policies,
    save_demonstrators,
    trained_policies,
)
from msrd_ros.studies.hopper.environment import Hopper, is_healthy, mean_speed
from msrd_ros.studies.shared.demonstrator_files import remake
from msrd_ros.studies.shared.divergence_truth import DivergenceTruth
from msrd_ros.studies.shared.posterior_truth import PosteriorTruth


class GaitReward:
    """Diversity + speed, and for the upright ones also a bonus for being healthy and a price for a fall.

    Parameters
    ----------
    diversity
        DIAYN's or the KL-encouraged reward, with the speed.
    recipe
        The rest.
    """

    def __init__(self, diversity: RewardSource, recipe: Recipe) -> None:
        self._diversity = diversity
        self._recipe = recipe

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """Reward of every transition, ``[S, K, T]``; 0 for getting up again."""
        recipe = self._recipe
        reward = self._diversity.reward(rollouts, policies)
        healthy = torch.as_tensor(is_healthy(rollouts.observations[: recipe.upright]))
        before, after = healthy[:, :, :-1], healthy[:, :, 1:]
        speed = extrinsic(torch.as_tensor(rollouts.observations[: recipe.upright, :, 1:]))
        upright = reward[: recipe.upright] - (speed - recipe.speed_cap).clamp(min=0.0)
        upright = torch.where(after, upright + recipe.healthy_bonus, upright - recipe.fall_cost)
        reward[: recipe.upright] = torch.where(before, upright, torch.zeros_like(upright))
        return reward


def make_demonstrators(recipe: Recipe, progress: Callable[[str], None] = lambda line: None) -> Demonstrators:
    """Train all strategies side by side and choose a hop and a crawl.

    The rule: every snapshot of every strategy is a candidate, judged on 4 episodes of 1,000 steps. A hop is
    of the upright strategies and healthy in at least 95 % of the states of each of them, and of 16 more (who
    falls does not get up); a crawl is of the free ones and keeps its torso below 0.6 m on average. Of the
    pairs within 5 % of each other's speed the fastest is taken, by the slower one's mean speed; if there is
    none, the pair closest in speed among those above 1 m/s.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    policies = gait_policies(recipe.strategies, generator, recipe.std)
    diversity = _diversity(recipe, generator)
    snapshots = _train(recipe, policies, diversity, progress)
    progress("demonstrators: judging the candidates")
    candidates = gait_policies(
        len(snapshots) * recipe.strategies, generator, recipe.play_std, recipe.play_std
    )
    candidates.set_flat(torch.cat(snapshots))
    played = BatchedCollector(Hopper()).collect(candidates, 4, np.random.default_rng([recipe.seed, 3]))
    speed = mean_speed(played.observations)
    height = played.observations[..., 1].mean(axis=(1, 2))
    upright = np.arange(len(speed)) % recipe.strategies < recipe.upright
    hops = upright & _stays_healthy(played.observations)
    hops[hops] = _stays_healthy(_play_again(candidates.flat()[hops], recipe))
    hop, crawl = choose_pair(speed.mean(axis=1), hops, (height < 0.6) & ~upright)
    strategies = (hop % recipe.strategies, crawl % recipe.strategies)
    flat = candidates.flat()
    # The truth is that of the demonstrators as they are, beside the last snapshots of the strategies that
    # were not chosen.
    settled = list(range(len(speed) - recipe.strategies, len(speed)))
    settled[strategies[0]], settled[strategies[1]] = hop, crawl
    truth: GaitTruth
    if isinstance(diversity, DiaynReward):
        states = torch.as_tensor(played.observations[settled][:, :, 1:]).flatten(1, 2)
        for _ in range(100):
            diversity.fit(states)
        truth = PosteriorTruth(diversity.posterior, hopper_features(), strategies, recipe.floor)
    else:
        assert recipe.divergence_bound is not None
        trained = trained_policies(torch.cat(snapshots)[settled], recipe)
        truth = DivergenceTruth(trained, recipe.divergence_bound, strategies)
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
    hop_and_crawl, others = (played_policies(flat[taken], recipe) for taken in ([hop, crawl], rest))
    return Demonstrators(recipe, hop_and_crawl, others, truth, report)


def _diversity(recipe: Recipe, generator: torch.Generator) -> RewardSource:
    if recipe.divergence_bound is not None:
        weight = recipe.weight / (recipe.strategies - 1)
        return KLEncouragedReward(extrinsic, weight, recipe.divergence_bound)
    return DiaynReward(
        recipe.strategies,
        hopper_features(),
        POSTERIOR_HIDDEN,
        extrinsic,
        recipe.weight,
        generator,
        floor=recipe.floor,
    )


def _stays_healthy(observations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether every one of the episodes ``[C, K, T+1, 12]`` is healthy almost throughout, ``[C]``."""
    return np.asarray((is_healthy(observations).mean(axis=2) >= 0.95).all(axis=1))


def _play_again(flat: Tensor, recipe: Recipe) -> NDArray[np.float32]:
    """16 more episodes of each of the policies ``flat [C, P]``."""
    collector = BatchedCollector(Hopper())
    return collector.collect(
        played_policies(flat, recipe), 16, np.random.default_rng([recipe.seed, 4])
    ).observations


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
    recipe: Recipe, policies: GaussianPolicies, diversity: RewardSource, progress: Callable[[str], None]
) -> list[Tensor]:
    """Run all stages; snapshots of the policies, ``[S, P]`` each."""
    autoreset = (True,) * recipe.upright + (False,) * recipe.free
    training = PolicyTraining(
        policies,
        hopper_features(),
        GaitReward(diversity, recipe),
        BatchedCollector(Hopper(1)),
        1,
        TrustRegionConfig(kl=recipe.kl, fisher_fraction=0.3),
        ValueConfig(hidden=(64, 64), steps=40, sees_time=False, bootstrap=True),
        recipe.seed,
    )
    snapshots: list[Tensor] = []
    done = 0
    for count, episodes, steps in recipe.stages:
        training.collector, training.episodes = BatchedCollector(Hopper(steps, autoreset=autoreset)), episodes
        for _, metrics in iterations(training, count):
            done += 1
            if done % 20 == 0:
                progress(f"demonstrators: iteration {done}, reward {metrics['reward']:.2f}")
            if done % recipe.snapshot_every == 0:
                snapshots.append(policies.flat())
    return snapshots


def main() -> None:
    """Make the cached files again from the recipes in their headers: all, or those named."""
    remake(
        sys.argv[1:] or [*PAIRS, KL_ENCOURAGED_PAIR, TUNING_PAIR],
        cached_demonstrators,
        make_demonstrators,
        lambda pair, made: save_demonstrators(pair_path(pair), made),
    )


if __name__ == "__main__":
    main()
