"""What each part of the default recipe brings, on a task that nothing is judged on.

Run from the repository: ``python benchmarks/recipe.py [--only NAME ...] [--seeds 2] [--method msrd]``. Ten
scripted ways to dock, three demonstrations each (`docking.py`); R0 is judged on 1,000 trajectories of bad
demonstrators and of networks at random, drawn so that a fifth is lost and an eighth comes to rest. Prints one
line for each variant and seed: r, Spearman's and r among trajectories that neither are lost nor rest, of the
mean of R0 and the true return; how many strategies of ten have the highest strategy reward of all on their
own demonstrations; the mean true return of the policies as cloned and as learned.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from docking import ACTIONS, OBSERVATIONS, STEP_S, STEPS, WAYS, Docking, demonstrator
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods import METHODS
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.rewards import RewardEnsemble, RewardForm
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations, Transitions
from msrd_ros.studies.lunar_lander.evaluation import judge_task
from msrd_ros.studies.lunar_lander.methods import nearness
from msrd_ros.studies.lunar_lander.test_sets import TestSet

NOISE = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5)
"""Of bad demonstrators' actions."""
NETWORK_SHARES = (1.0, 1.0, 0.7, 0.7, 0.4, 0.4)
"""How far a network at random decides instead of a bad demonstrator."""
LOST, RESTED, TRAJECTORIES = 200, 125, 1000


def demonstrations(count: int, seed: int) -> Demonstrations:
    """`count` of each way."""
    rng = np.random.default_rng(seed)
    world = Docking()
    seen, done = [world.reset(len(WAYS), count, rng)], []
    for step in range(STEPS):
        action = np.stack([demonstrator(way, step, seen[-1][way]) for way in range(len(WAYS))])
        flying = seen[-1][..., 6:7] < 0.5
        done.append(np.clip(action + 0.1 * flying * rng.standard_normal(action.shape), -1.0, 1.0))
        seen.append(world.step(done[-1]))
    names = tuple(f"way {way}" for way in range(len(WAYS)))
    layout = Layout(OBSERVATIONS, ACTIONS, names, STEP_S)
    return Demonstrations(np.stack(seen, axis=2), np.stack(done, axis=2).astype(np.float32), layout)


def trajectories(seed: int) -> TestSet:
    """What R0 is judged on."""
    rng = np.random.default_rng(seed)
    parts = [_played(rng, noise, 0.0) for noise in NOISE]
    parts += [_played(rng, 0.3, share) for share in NETWORK_SHARES]
    states, truth, lost, rested = (np.concatenate(part) for part in zip(*parts, strict=True))
    kinds = ((lost, LOST), (rested & ~lost, RESTED), (~lost & ~rested, TRAJECTORIES - LOST - RESTED))
    rows = np.concatenate([rng.choice(np.flatnonzero(kind), count, replace=False) for kind, count in kinds])
    nobody = np.zeros(len(rows), dtype=np.int64)
    return TestSet(states[rows], truth[rows], lost[rows], rested[rows], nobody)


def _played(rng: np.random.Generator, noise: float, share: float) -> tuple[NDArray[Any], ...]:
    world, each = Docking(), 30
    shape = (len(WAYS), each)
    seen = [world.reset(*shape, rng)]
    gain, slip = rng.uniform(0.3, 1.6, shape), rng.normal(0.0, 0.5, shape)
    weight = rng.normal(0.0, 0.6, (*shape, len(OBSERVATIONS), len(ACTIONS)))
    bias = np.stack([rng.uniform(0.1, 0.5, shape), rng.normal(0.0, 0.05, shape)], axis=-1)
    for step in range(STEPS):
        action = np.stack(
            [demonstrator(way, step, seen[-1][way], gain[way], slip[way]) for way in range(len(WAYS))]
        )
        network = np.tanh(np.einsum("sko,skoa->ska", 0.3 * seen[-1], weight) + bias)
        action = (1.0 - share) * action + share * network
        seen.append(world.step(action + noise * rng.standard_normal(action.shape)))
    states = np.stack(seen, axis=2).reshape(-1, STEPS + 1, len(OBSERVATIONS))
    return states, world.returns().ravel(), world.lost.ravel(), world.rested.ravel()


def _penalty(weight: float) -> Callable[[MSRDConfig], MSRDConfig]:
    return lambda config: replace(config, discriminator=replace(config.discriminator, penalty_weight=weight))


def _snapshots(share: float) -> Callable[[MSRDConfig], MSRDConfig]:
    return lambda config: replace(config, replay=replace(config.replay, snapshot_share=share))


def _price(price: float) -> Callable[[MSRDConfig], MSRDConfig]:
    return lambda config: replace(config, policy=replace(config.policy, reference_price=price))


VARIANTS: dict[str, Callable[[MSRDConfig], MSRDConfig]] = {
    "default": lambda config: config,
    "without nearness": lambda config: replace(config, reward=replace(config.reward, nearness=0.0)),
    "without displaced": lambda config: replace(config, replay=replace(config.replay, displaced_share=0.0)),
    "without both": lambda config: VARIANTS["without nearness"](VARIANTS["without displaced"](config)),
    "penalty .05": _penalty(0.05),
    "penalty .5": _penalty(0.5),
    "fewer bad examples": _snapshots(0.3),
    "cross-negatives reach R0": lambda config: replace(
        config, discriminator=replace(config.discriminator, cross_reaches_task=True)
    ),
    "without log pi": lambda config: replace(
        config, discriminator=replace(config.discriminator, uses_log_prob=False)
    ),
    "a nat away from the clone costs 1": _price(1.0),
    "the paper's loss": as_printed,
}


def mean_return(policies: Policies) -> float:
    """Of every way, without noise."""
    world = Docking()
    episodes = 200 // policies.strategies
    BatchedCollector(world).collect(policies, episodes, np.random.default_rng(3), deterministic=True)
    return float(world.returns().mean())


def measure(config: MSRDConfig, method: str, seed: int, shown: Demonstrations, test: TestSet) -> str:
    """Train once; the figures in words."""
    problem = Problem(config, shown, BatchedCollector(Docking()), seed)
    learner = METHODS[method].start(problem)
    learner.clone()
    cloned = mean_return(learner.policies)
    for _ in range(learner.config.iterations):
        learner.iterate()
    rewards = learner.averaged_rewards.requires_grad_(False)
    marks = judge_task(RewardEnsemble([rewards]).task, test)
    told = ", ".join(f"{name} {value:.3f}" for name, value in marks.items())
    if rewards.form is RewardForm.TWO_COLUMN:
        told += f", own {_own(rewards, shown)} of {shown.strategies}"
    return f"{told}, return {cloned:.0f}, then {mean_return(learner.policies):.0f}"


def _own(rewards: Any, shown: Demonstrations) -> int:
    """Strategies whose S_i is highest of all on their own demonstrations."""
    count = shown.strategies
    states, actions = torch.as_tensor(shown.observations), torch.as_tensor(shown.actions)
    values = np.empty((count, count))
    for whose in range(count):
        same = [part[whose : whose + 1].expand(count, -1, -1, -1) for part in (states, actions)]
        values[:, whose] = rewards(Transitions.of(same[0], same[1])).strategy.mean(dim=1)
    return int((values.argmax(axis=0) == np.arange(count)).sum())


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--method", default="msrd", choices=("msrd", "airl"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    shown, test = demonstrations(3, 5), trajectories(77)
    yardstick = judge_task(nearness(shown.observations.reshape(-1, len(OBSERVATIONS))), test)
    print("distance to the demonstrations:", ", ".join(f"{k} {v:.3f}" for k, v in yardstick.items()))
    for name in arguments.only:
        for seed in range(arguments.seeds):
            config = VARIANTS[name](default_config(restarts=False))
            print(f"{name}, seed {seed}: {measure(config, arguments.method, seed, shown, test)}", flush=True)


if __name__ == "__main__":
    main()
