"""Policies in the batched simulator: all strategies side by side, each ball with a target of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS
from msrd_ros.learning.checkpoints import import_policies
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyResults,
    RallyVariation,
)
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

Array = NDArray[np.float64]

BatchPolicy = Callable[[Array], NDArray[np.floating]]
"""From observations (S, K, N + 6) to actions (S, K, N)."""


def make_simulator(policies: StrokePolicies, variation: RallyVariation, threads: int) -> KinematicRallies:
    """The batched simulator for all strategies of a set."""
    plans = [RallyPlan(facts.side, facts.ready_pose) for facts in policies.facts.values()]
    config = KinematicRalliesConfig(variation=variation, threads=threads, robot=policies.robot)
    return KinematicRallies(plans, config)


def batch_policy(policies: StrokePolicies, targets: Array) -> BatchPolicy:
    """Mean actions of all strategies, each ball's target (S, K, 2), m, among what they see.

    Policies that take no target do not look at them.
    """
    network = import_policies(policies.policies)
    if not policies.takes_target:
        return network.act
    return lambda observations: network.act(np.concatenate([observations, targets], axis=-1))


def play_batch(
    policies: StrokePolicies,
    targets: Array,
    variation: RallyVariation,
    rng: np.random.Generator,
    threads: int = 1,
) -> tuple[RallyResults, NDArray[np.float32]]:
    """What becomes of new balls when mean actions are played.

    Parameters
    ----------
    targets
        As of `batch_policy`; K balls are played of each strategy.

    Returns
    -------
    What became of the balls, and what was seen of them and of the arm, (S, K, T + 1, N + 6).
    """
    simulator, act = make_simulator(policies, variation, threads), batch_policy(policies, targets)
    seen = simulator.reset(len(policies.facts), targets.shape[1], rng)
    observations = np.empty((*seen.shape[:2], simulator.horizon + 1, seen.shape[-1]), np.float32)
    observations[:, :, 0] = seen
    rest = np.zeros((*seen.shape[:2], policies.robot.joint_count))
    for step in range(simulator.horizon):
        seen = simulator.step(act(seen) if step < ACTING_STEPS else rest)
        observations[:, :, step + 1] = seen
    return simulator.results(), observations


def land_near(results: RallyResults, targets: Array, distance_m: float) -> NDArray[np.bool_]:
    """Which balls were returned and landed so near to their targets (S, K, 2), m: (S, K)."""
    apart = np.linalg.norm(results.landing - targets, axis=-1)
    near: NDArray[np.bool_] = results.returned & (apart <= distance_m)
    return near
