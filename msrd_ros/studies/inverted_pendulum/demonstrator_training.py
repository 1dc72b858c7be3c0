"""Training demonstrators and choosing among them."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from msrd_ros.core.errors import UserError
from msrd_ros.learning.diayn import DiaynReward
from msrd_ros.learning.harness import iterations
from msrd_ros.learning.kl_encouraged import KLEncouragedReward
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.reinforcement import PolicyTraining, RewardSource
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.inverted_pendulum.curriculum import Stage, train_in_stages
from msrd_ros.studies.inverted_pendulum.demonstrators import (
    POSTERIOR_HIDDEN,
    STRATEGIES,
    Demonstrators,
    Kind,
    Recipe,
    cached_demonstrators,
    cached_path,
    fresh_policies,
    save_demonstrators,
)
from msrd_ros.studies.inverted_pendulum.environment import has_fallen, task_reward
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.truths import (
    KnownPreferences,
    PreferenceReward,
    extrinsic,
    pendulum_features,
)
from msrd_ros.studies.shared.demonstrator_files import remake
from msrd_ros.studies.shared.divergence_truth import DivergenceTruth
from msrd_ros.studies.shared.posterior_truth import PosteriorTruth
from msrd_ros.studies.shared.task import StrategyTruth

_FEWEST = 8
_STANDING = (Stage(60, 30, 50), Stage(60, 15, 100))
_START_KL = 0.03


def make_demonstrators(recipe: Recipe, progress: Callable[[str], None] = lambda line: None) -> Demonstrators:
    """Train candidates and keep up to 20 of them.

    The rule: a candidate must stay up in every one of 10 episodes of 1,000 steps and lose no more than
    0.05 rad a step on average; of those, the 20 most distinct are kept (distinctness: how often a fresh
    classifier of states, fitted on other episodes, recognises it). DIAYN has to give 20; of the 20 known
    preferences and of the KL-encouraged candidates those that pass are kept, at least 8.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    count = STRATEGIES if recipe.kind is Kind.KNOWN_PREFERENCE else recipe.candidates
    policies = fresh_policies(count, generator)
    if recipe.start_iterations:
        start = _balancing_policies(recipe, generator).flat()
        start[:, -1] = float(np.log(0.3))  # room to explore again
        policies.set_flat(start.expand(count, -1))
    source: RewardSource
    if recipe.kind is Kind.DIAYN:
        source = DiaynReward(
            count,
            pendulum_features(),
            POSTERIOR_HIDDEN,
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
    short = Stage(recipe.short_iterations, recipe.episodes, recipe.short_steps)
    long = Stage(recipe.long_iterations, 3, 1000)
    train_in_stages(training, (short, long), progress=lambda line: progress(f"demonstrators: {line}"))
    if isinstance(source, DiaynReward):
        _settle_posterior(source, policies, recipe.seed)
    kept, report = _choose(policies, recipe)
    chosen = _subset(policies, kept)
    return Demonstrators(recipe, chosen, _truth(source, policies, recipe, kept), report)


def _truth(
    source: RewardSource, policies: GaussianPolicies, recipe: Recipe, kept: tuple[int, ...]
) -> StrategyTruth:
    if isinstance(source, DiaynReward):
        return PosteriorTruth(source.posterior, pendulum_features(), kept)
    if isinstance(source, KLEncouragedReward):
        return DivergenceTruth(policies, recipe.bound, kept)
    return KnownPreferences.twenty().subset(kept)


def _balancing_policies(recipe: Recipe, generator: torch.Generator) -> GaussianPolicies:
    """What has learned the task and nothing else: one policy, or for the KL-encouraged every candidate.

    Two equal policies have a divergence without slope: who is to become different needs a start of its own.
    From one policy for all, 8 to 12 of 12 candidates stayed up, at nearly the same place and with truths that
    correlated .96; from starts of their own 16 of 20, .4 (weight .1, bound 3, 40 updates).
    """
    if recipe.kind is Kind.KL_ENCOURAGED:
        policies = fresh_policies(recipe.candidates, generator)
        middle = _in_the_middle(recipe.candidates, 0.4)
        training = _training(policies, middle, recipe.episodes, replace(recipe, kl=_START_KL))
        train_in_stages(training, (*_STANDING, Stage(recipe.start_iterations, 5, 300)))
        return policies
    policy = fresh_policies(1, torch.Generator().manual_seed(recipe.seed + 10))
    training = _training(policy, _in_the_middle(1, 0.4), 4 * recipe.episodes, recipe)
    for _ in iterations(training, recipe.start_iterations):
        pass
    return policy


def _in_the_middle(count: int, width_m: float) -> PreferenceReward:
    """The task and a cart near the middle."""
    return PreferenceReward(
        KnownPreferences(
            (0,) * count, (0.0,) * count, (width_m,) * count, (False,) * count, (math.inf,) * count
        ),
        0.1,
    )


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
        recipe.seed,
    )


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
        POSTERIOR_HIDDEN,
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
    chosen = fresh_policies(len(kept), torch.Generator().manual_seed(0))
    chosen.set_flat(policies.flat()[list(kept)])
    return chosen


def main() -> None:
    """Make the cached files again from the recipes in their headers: all, or those named."""
    remake(
        sys.argv[1:] or list(Kind),
        lambda kind: cached_demonstrators(Kind(kind)),
        make_demonstrators,
        lambda kind, made: save_demonstrators(cached_path(Kind(kind)), made),
    )


if __name__ == "__main__":
    main()
