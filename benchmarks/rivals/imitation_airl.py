"""AIRL of the `imitation` library with sb3-contrib's TRPO, for `make benchmarks`.

Runs in an environment of its own, because `imitation` pins old versions: `side_by_side/rivals.py` makes it.
Arguments: the exchange file with demonstrations and test trajectories, the output file, environment steps.
"""

from __future__ import annotations

import sys
import time
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
import torch
from imitation.algorithms.adversarial.airl import AIRL
from imitation.data import rollout
from imitation.data.types import Trajectory
from imitation.rewards.reward_nets import BasicShapedRewardNet
from imitation.util.networks import RunningNorm
from sb3_contrib import TRPO
from stable_baselines3.common.vec_env import DummyVecEnv


class NoTermination(gymnasium.Wrapper[np.ndarray, np.ndarray, np.ndarray, np.ndarray]):
    """The paper's environment: the episode goes on when the pole has fallen."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, SupportsFloat, bool, bool, dict[str, Any]]:
        """As the environment steps, without its end."""
        observation, reward, _, truncated, info = self.env.step(action)
        return observation, reward, False, truncated, info


def make(steps: int) -> gymnasium.Env[np.ndarray, np.ndarray]:
    """One environment of `steps` steps an episode."""
    world = gymnasium.make("InvertedPendulum-v4", max_episode_steps=steps)
    return NoTermination(world)


def main() -> None:
    """Train, and note at intervals processor time, steps, and the mean reward of every test trajectory."""
    exchange, output, budget = sys.argv[1], sys.argv[2], int(sys.argv[3])
    torch.set_num_threads(1)
    data = np.load(exchange)
    demonstrations = [
        Trajectory(obs=o.astype(np.float64), acts=a.astype(np.float32), infos=None, terminal=False)
        for o, a in zip(data["observations"], data["actions"], strict=True)
    ]
    tests = torch.as_tensor(data["tests"], dtype=torch.float32)
    envs = DummyVecEnv([lambda: make(250) for _ in range(8)])
    learner = TRPO(
        "MlpPolicy",
        envs,
        n_steps=1250,
        batch_size=1000,
        gamma=0.99,
        gae_lambda=0.97,
        target_kl=0.01,
        policy_kwargs={"net_arch": [32, 32]},
        seed=0,
        device="cpu",
    )
    network = BasicShapedRewardNet(
        envs.observation_space,
        envs.action_space,
        use_state=False,
        use_action=False,
        use_next_state=True,
        normalize_input_layer=RunningNorm,
        reward_hid_sizes=(32, 32),
        potential_hid_sizes=(32, 32),
    )
    trainer = AIRL(
        demonstrations=rollout.flatten_trajectories(demonstrations),
        demo_batch_size=2560,
        gen_replay_buffer_capacity=100_000,
        n_disc_updates_per_round=10,
        venv=envs,
        gen_algo=learner,
        reward_net=network,
        allow_variable_horizon=True,
    )
    times, steps, estimates = [], [], []
    started = time.process_time()

    def note(round_number: int) -> None:
        elapsed = time.process_time() - started - sum(paused)
        begin = time.process_time()
        with torch.no_grad():
            states = tests[:, 1:].reshape(-1, 4)
            blank = torch.zeros(states.shape[0], 1)
            done = torch.zeros(states.shape[0])
            values = network.base(states, blank, states, done).reshape(tests.shape[0], -1).mean(dim=1)
        times.append(elapsed)
        steps.append((round_number + 1) * 8 * 1250)
        estimates.append(values.numpy())
        np.savez(output, times=times, steps=steps, estimates=np.stack(estimates))
        paused.append(time.process_time() - begin)

    paused: list[float] = []
    trainer.train(budget, callback=note)


if __name__ == "__main__":
    main()
