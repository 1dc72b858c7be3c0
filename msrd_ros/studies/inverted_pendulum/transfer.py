"""What a reward is for: fresh policies trained on frozen rewards, also where the dynamics have changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.inverted_pendulum.curriculum import Stage, train_in_stages
from msrd_ros.studies.inverted_pendulum.demonstrators import fresh_policies
from msrd_ros.studies.inverted_pendulum.dynamics import PendulumBody
from msrd_ros.studies.inverted_pendulum.environment import has_fallen, task_reward
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.truths import pendulum_features
from msrd_ros.studies.shared.estimates import Estimate, Rewards, by_row
from msrd_ros.studies.shared.evaluation import table_over
from msrd_ros.studies.shared.frozen_rewards import FrozenReward, frozen_rewards
from msrd_ros.studies.shared.task import Demonstrators

BODIES = {
    "as demonstrated": PendulumBody(),
    "pole 30 % longer, cart friction doubled": PendulumBody().changed(pole_length=1.3, cart_friction=2.0),
}


@dataclass(frozen=True)
class TransferPlan:
    """Training of the fresh policies, the same for every reward and for the truth.

    A policy that knows nothing falls within 20 steps and then lies there: on long episodes nearly all of the
    data are of lying. Many short episodes first teach it to stand; longer ones, where to. Chosen by the truth
    alone, on tuning seeds: of 20 fresh policies on the true rewards 2 stood after 100 updates on 3 episodes
    of 400 steps (18 s of one core); 12 after 40 on 30 of 50 steps, 18 after 40 more on 15 of 100 (15 s), half
    of them within 2 cm of the demonstrator's place; 17 after 40 more on 4 of 400: four are too few to go by.
    60 updates in each of the first two stages left 6 standing of 6 (other strategies, another seed).

    Attributes
    ----------
    stages
        One after the other.
    seed
        Of initial weights, training and judging.
    """

    stages: tuple[Stage, ...] = (Stage(60, 30, 50), Stage(60, 15, 100), Stage(20, 10, 200))
    seed: int = 4000


def run_transfer(
    plan: TransferPlan,
    demonstrators: Demonstrators,
    estimates: dict[str, Estimate],
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """Train on every reward under every body; marks by body, method and reward, then per strategy."""
    preference = by_row(demonstrators.truth.table)

    def true_reward(states: Tensor) -> Tensor:
        return -states[..., 1].abs() + 0.1 * preference(states).clamp(min=-10.0)

    results: dict[str, Any] = {}
    for name, body in BODIES.items():
        table: dict[str, Any] = {
            "demonstrators": {
                "their own policies": _judge(demonstrators.policies, demonstrators, body, plan.seed)
            },
            "truth": {"true R0 + 0.1 S_i": _train(plan, demonstrators, body, true_reward)},
        }
        for method, estimate in estimates.items():
            rows = {}
            for reward, function in frozen_rewards(estimate).items():
                progress(f"transfer, {name}: fresh policies on {method}'s {reward}")
                rows[reward] = _train(plan, demonstrators, body, function)
            table[method] = rows
        results[name] = table
    return results


def _train(
    plan: TransferPlan, demonstrators: Demonstrators, body: PendulumBody, rewards: Rewards
) -> dict[str, Any]:
    strategies = demonstrators.policies.strategies
    policies = fresh_policies(strategies, torch.Generator().manual_seed(plan.seed))
    training = PolicyTraining(
        policies,
        pendulum_features(),
        FrozenReward(rewards),
        PendulumCollector(plan.stages[0].horizon, body),
        plan.stages[0].episodes,
        TrustRegionConfig(kl=0.03),
        ValueConfig(hidden=(32, 32), steps=10, sees_time=False, bootstrap=True),
        plan.seed,
    )
    train_in_stages(training, plan.stages, body)
    return _judge(policies, demonstrators, body, plan.seed + 1)


def _judge(
    policies: GaussianPolicies, demonstrators: Demonstrators, body: PendulumBody, seed: int
) -> dict[str, Any]:
    """Task return a step, falls, and distance to the demonstrator's style, over 1,000 steps.

    The distance is that of the settled cart's mean position, in metres; the preference is the true strategy
    reward a step, clipped at -10.
    """
    collector = PendulumCollector(1000, body)
    played = collector.collect(policies, 3, np.random.default_rng(seed), deterministic=True).observations
    settled = played[:, :, 500:, 0].mean(axis=(1, 2))
    home = np.array(demonstrators.report["cart_position_mean"])
    flat = played.reshape(-1, *played.shape[2:])
    truth = table_over(lambda states: demonstrators.truth.table(states).clamp(min=-10.0), flat)
    truth = truth.reshape(truth.shape[0], played.shape[0], -1)
    own = truth[np.arange(played.shape[0]), np.arange(played.shape[0])].mean(axis=1)
    return {
        "task_return": task_reward(played[:, :, 1:]).mean(axis=(1, 2)).tolist(),
        "fallen": has_fallen(played).mean(axis=1).tolist(),
        "style_distance_m": np.abs(settled - home).tolist(),
        "true_preference": own.tolist(),
        "cart_position": settled.tolist(),
    }
