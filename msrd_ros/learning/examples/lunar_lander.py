"""Two ways to land: ``python -m msrd_ros.learning.examples.lunar_lander [OUT]`` trains and records them anew.

Both land Gymnasium's LunarLander on its pad; ``left`` swings out to the left on its way down, ``right`` to
the right. Policies are trained with TRPO on the environment's own reward less a price on leaving that way.
Kept are ten landings of each, the first of fresh episodes that come to rest with a good return. Takes a
quarter of an hour on one core.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.learning.environment import GymCollector, GymEnvironment
from msrd_ros.learning.harness import iterations
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.reinforcement import PolicyTraining
from msrd_ros.learning.trajectories import Rollouts
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig

ENVIRONMENT = "LunarLanderContinuous-v3"
LABELS = ("left", "right")
OBSERVATION_NAMES = ("x", "y", "vx", "vy", "angle", "rate", "left_leg", "right_leg")
ACTION_NAMES = ("main_engine", "side_engine")
SCALES = (0.3, 0.7, 0.4, 0.4, 0.3, 0.3, 1.0, 1.0)

SWING = 0.35
"""How far out each way swings, half-way down, in half widths of the screen."""
SWING_PRICE = 40.0
"""Of the squared distance from the way, in each step above the pad."""
HORIZON, EPISODES, UPDATES = 500, 12, 200
CANDIDATE_EVERY = 20
KEPT = 10
GOOD_RETURN = 200.0


class LandingReward:
    """The environment's own reward, less the price on leaving the strategy's way; in units of 20."""

    def reward(self, rollouts: Rollouts, policies: Policies) -> Tensor:
        """``[S, K, T]``."""
        assert rollouts.environment_reward is not None
        assert rollouts.acting is not None
        strayed = np.minimum(np.square(off_course(rollouts.observations[:, :, 1:])), 0.25)
        steps = np.arange(rollouts.environment_reward.shape[-1])
        price = SWING_PRICE * strayed * (steps < rollouts.acting[..., None])
        return torch.as_tensor((rollouts.environment_reward - price) / 20.0, dtype=torch.float32)


def off_course(observations: NDArray[np.floating]) -> NDArray[np.float64]:
    """Distance of states ``[2, ..., 8]`` from the way that row's strategy comes down, ``[2, ...]``."""
    x, height = observations[..., 0], np.clip(observations[..., 1] / 1.4, 0.0, 1.0)
    side = np.array([-1.0, 1.0]).reshape(2, *(1,) * (x.ndim - 1))
    return np.asarray(np.where(height > 0.05, x - side * SWING * np.sin(np.pi * height), 0.0))


def train_landers(seed: int) -> GaussianPolicies:
    """One policy for each strategy: the latest candidates, if they are the best on episodes of their own."""
    environment = GymEnvironment(ENVIRONMENT, HORIZON, OBSERVATION_NAMES, ACTION_NAMES)
    features = Features(tuple(range(8)), (0.0,) * 8, SCALES)
    generator = torch.Generator().manual_seed(seed)
    bounds = (float(np.log(0.6)), float(np.log(0.1)), 0.0)
    policies = GaussianPolicies(2, features, 2, (64, 64), *bounds, generator)
    training = PolicyTraining(
        policies,
        features,
        LandingReward(),
        GymCollector(environment),
        EPISODES,
        TrustRegionConfig(kl=0.02, damping=0.05, entropy_weight=0.003),
        ValueConfig(steps=60, sees_time=False, bootstrap=True),
        seed=seed,
    )
    best, parameters = torch.full((2,), -torch.inf), policies.flat()
    for update, _ in iterations(training, UPDATES):
        if update % CANDIDATE_EVERY == 0:
            played = GymCollector(environment).collect(policies, 10, np.random.default_rng([seed, 1]), True)
            score = LandingReward().reward(played, policies).sum(dim=-1).mean(dim=-1)
            parameters = torch.where((score > best)[:, None], policies.flat(), parameters)
            best = torch.maximum(best, score)
            returns = _returns(played).mean(axis=-1).round().tolist()
            print(f"update {update} of {UPDATES}: returns {returns}", flush=True)
    policies.set_flat(parameters)
    return policies


def record(policies: GaussianPolicies, seed: int) -> dict[str, NDArray[Any]]:
    """Landings of each strategy as arrays ``observations/left/0`` and so on, with little noise on actions."""
    environment = GymEnvironment(ENVIRONMENT, HORIZON, OBSERVATION_NAMES, ACTION_NAMES)
    with torch.no_grad():
        policies.log_std.fill_(float(np.log(0.05)))
    played = GymCollector(environment).collect(policies, 4 * KEPT, np.random.default_rng([seed, 2]))
    assert played.acting is not None
    assert played.lengths is not None
    landed = (played.acting < played.lengths) & (_returns(played) > GOOD_RETURN)
    print(f"landed: {landed.mean(axis=1).tolist()}, returns {_returns(played).mean(axis=1).tolist()}")
    arrays: dict[str, NDArray[Any]] = {
        "observation_names": np.array(OBSERVATION_NAMES),
        "action_names": np.array(ACTION_NAMES),
    }
    for row, label in enumerate(LABELS):
        for number, episode in enumerate(np.flatnonzero(landed[row])[:KEPT]):
            steps = played.acting[row, episode]
            arrays[f"observations/{label}/{number}"] = played.observations[row, episode, : steps + 1]
            arrays[f"actions/{label}/{number}"] = played.actions[row, episode, :steps].clip(-1.0, 1.0)
    return arrays


def _returns(played: Rollouts) -> NDArray[np.float32]:
    """Of the environment's own reward, ``[S, K]``."""
    assert played.environment_reward is not None
    return np.asarray(played.environment_reward.sum(axis=-1))


def main() -> None:
    """Train, record, write."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".npz")
    arrays = record(train_landers(seed=0), seed=0)
    np.savez_compressed(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main()
