"""Multi-Strategy Reward Distillation: Algorithm 1 of the paper, top to bottom.

The paper's loop over strategies (line 5) is a tensor axis here: each line below does its work for all
strategies at once. With `TaskUpdate.SEQUENTIAL` the shared R0 still takes one step per strategy.
"""

from __future__ import annotations

import copy
import time
from typing import Any

import numpy as np
import torch
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import clone
from msrd_ros.learning.config import MSRDConfig, PolicyReward, RefitConfig, ReplayConfig
from msrd_ros.learning.derived import features_of
from msrd_ros.learning.displaced import Displacement
from msrd_ros.learning.endings import only_valid, require_usable
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.policy_improvement import PolicyImprovement
from msrd_ros.learning.reference_policy import ReferencePolicy
from msrd_ros.learning.replay import DemonstrationPool, Replay
from msrd_ros.learning.reward_training import Negatives, RewardTraining, used_log_prob
from msrd_ros.learning.rewards import AveragedRewards, Nearness, RewardModel
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts, Transitions


class MSRD:
    """Infers R0, S_i and pi_i from demonstrations of N strategies.

    Parameters
    ----------
    config
        Settings; `RewardForm` and a few switches make it AIRL or vanilla distillation instead.
    demonstrations
        D(1)..D(N) (line 1).
    collector
        Where the policies are played.
    seed
        Everything random follows from it; the same seed gives the same run bit for bit on one machine.
    policies
        Initial policies; None makes Gaussian ones from `config`.
    autoreset
        Where ``config.cloning.restarts`` are played: as `collector`, but episodes start again whenever the
        task is lost.

    Attributes
    ----------
    policies
        pi_1..pi_N.
    rewards
        R0 and S_1..S_N, the latest iterate.
    iterations_done, environment_steps
        How far training has come.
    """

    def __init__(
        self,
        config: MSRDConfig,
        demonstrations: Demonstrations,
        collector: Collector,
        seed: int,
        policies: Policies | None = None,
        autoreset: Collector | None = None,
    ) -> None:
        if config.cloning.restarts and autoreset is None:
            raise ValueError("cloning.restarts need a place where episodes start again: pass autoreset")
        self.config = config
        self.layout = demonstrations.layout
        self.iterations_done = 0
        self.environment_steps = 0
        self._collector = collector
        self._autoreset = autoreset or collector
        torch_seed, numpy_seed = np.random.SeedSequence(seed).spawn(2)
        self._generator = torch.Generator().manual_seed(int(torch_seed.generate_state(1, np.uint64)[0]) >> 1)
        self._rng = np.random.default_rng(numpy_seed)

        # Line 1: the demonstrations.  Lines 2 and 3: R0, S_i, pi_i and the weights alpha_i.
        strategies = demonstrations.strategies
        self._demonstrations = DemonstrationPool(demonstrations)
        self._displacement = Displacement(self._demonstrations)
        features = config.policy.features.build(demonstrations)
        derived = demonstrations.derived
        task_features = config.reward.task_features.build(demonstrations, derived)
        demonstrated = features_of(task_features, self._demonstrations.everything(), derived)[0]
        self.rewards = RewardModel(
            config.reward.form,
            strategies,
            task_features,
            config.reward.strategy_features.build(demonstrations, derived),
            len(self.layout.action_names) if config.reward.sees_action else 0,
            config.reward.hidden,
            config.reward.alpha,
            self._generator,
            config.reward.shaping,
            config.discount,
            config.reward.reward_groups,
            Nearness.of(demonstrated, config.reward.nearness),
            (*self.layout.observation_names, *(() if derived is None else derived.names)),
            derived,
        )
        highest = max(self.rewards.task_features.highest, self.rewards.strategy_features.highest)
        if config.replay.displaced_share and highest >= len(self.layout.observation_names):
            raise UserError(
                "replay.displaced_share: of a displaced state no column can be derived, and rewards see "
                "some; use 0"
            )
        self.policies: Policies = policies or GaussianPolicies(
            strategies,
            features,
            len(self.layout.action_names),
            config.policy.hidden,
            float(np.log(config.policy.std)),
            float(np.log(config.policy.std_min)),
            float(np.log(config.policy.std_max)),
            self._generator,
        )
        self._improvement = PolicyImprovement(
            self.policies,
            features,
            config.trust_region,
            config.value,
            config.discount,
            config.gae_decay,
            self._generator,
        )
        self._averaged = AveragedRewards(self.rewards, config.discriminator.ema_rate)
        self._training = RewardTraining(self.rewards, self._averaged, config.discriminator, config.iterations)
        widths = (len(self.layout.observation_names), len(self.layout.action_names))
        capacity = config.replay.keep * config.replay.iterations if config.replay.replay_share > 0.0 else 0
        capacity = min(capacity, config.replay.keep * config.iterations)
        self._replay = Replay(strategies, capacity, *widths)
        self._snapshots: Transitions | None = None
        self._reference = ReferencePolicy(self.policies, config.policy.reference_price)

    @property
    def progress(self) -> float:
        """Share of the planned iterations that are done, for schedules; 1 from the last one on."""
        return min(1.0, self.iterations_done / max(1, self.config.iterations - 1))

    @property
    def averaged_rewards(self) -> RewardModel:
        """R0 and S_i averaged over iterations: the ones to report."""
        return self._averaged.model

    def clone(self) -> dict[str, float]:
        """Start the policies near the demonstrations (behaviour cloning; not in the paper's algorithm)."""
        played: list[Transitions] = []

        def play_snapshot(collector: Collector = self._collector) -> None:
            rollouts = self._collect(self.config.cloning.snapshot_episodes, collector)
            played.append(only_valid(self._transitions(rollouts), rollouts.lengths))

        if not isinstance(self.policies, GaussianPolicies):
            raise TypeError("only Gaussian policies can be cloned")
        error = clone(
            self.policies,
            self._demonstrations,
            self.layout.observation_names,
            self.layout.action_names,
            self.config.cloning,
            self._generator,
            play_snapshot,
        )
        with torch.no_grad():
            explored = self.policies.log_std.clone()
            for collector, deviations in (
                (self._collector, self.config.cloning.noise_levels),
                (self._autoreset, self.config.cloning.restarts),
            ):
                for deviation in deviations:
                    self.policies.log_std.fill_(float(np.log(deviation)))
                    play_snapshot(collector)
            self.policies.log_std.copy_(explored)
        self._snapshots = Transitions.join(played) if played else None
        self._reference = ReferencePolicy(self.policies, self.config.policy.reference_price)
        return {"cloning_error": float(error.mean())}

    def iterate(self) -> dict[str, float]:
        """One pass of lines 5 to 11 over all strategies; returns what happened, by name."""
        started = time.perf_counter()
        config = self.config

        # Line 6: collect K trajectories of every policy.
        rollouts = self._collect(config.episodes, self._collector)
        everything = self._transitions(rollouts)
        generated = only_valid(everything, rollouts.lengths)

        # Line 7: sample demonstrations of every strategy.
        count = config.discriminator.demonstrations_per_iteration
        chosen = self._demonstrations.choose(count, self._generator)

        # Line 8: train S_i and R0 with Equation 7.
        steps = config.discriminator.steps
        if self.iterations_done == 0:
            steps += config.discriminator.first_steps
        amount = steps * config.discriminator.batch
        expert = self._demonstrations.sample(chosen, amount, self._generator)
        expert = expert.with_log_prob(self._log_prob(expert))
        negatives = self._negatives(generated, config.replay, amount, self._generator)
        metrics = self._training.train(expert, negatives, steps, self.iterations_done, self._generator)
        if config.replay.replay_share > 0.0:
            self._replay.add(generated, config.replay.keep, self._generator)

        # Line 9: give every generated transition the reward R_i.
        reward = self._reward(everything).reshape(*rollouts.actions.shape[:2], -1)

        # Line 10: update the policies by TRPO with entropy bonus.
        metrics |= self._improvement.improve(rollouts, reward, self.progress)

        self.iterations_done += 1
        metrics["reward"] = float(reward.mean())
        metrics["environment_steps"] = float(self.environment_steps)
        metrics["seconds"] = time.perf_counter() - started
        return metrics

    def refit_on_replay(self, refit: RefitConfig) -> RewardModel:
        """R0 and S_i after more Adam steps against all that was ever played, to optimise frozen.

        An iteration's negatives are mostly of the present policies, so rewards forget what earlier ones did
        wrong, and a fresh policy finds its way there. Needs replay and cloning snapshots; the run stays as
        it is.
        """
        if not self._replay.filled or self._snapshots is None:
            raise ValueError("to refit on replay takes replay and cloning snapshots; give both a share")
        generator = torch.Generator().manual_seed(self.iterations_done)
        config = self.config.discriminator
        rewards = copy.deepcopy(self.rewards)
        averaged = AveragedRewards(rewards, refit.ema_rate)
        training = RewardTraining(rewards, averaged, config, iterations=1)
        everything = self._demonstrations.choose(None, generator)
        amount = config.steps * config.batch
        for _ in range(refit.steps // config.steps):
            expert = self._demonstrations.sample(everything, amount, generator)
            expert = expert.with_log_prob(self._log_prob(expert))
            past = self._negatives(self._snapshots, refit.negatives, amount, generator)
            training.train(expert, past, config.steps, 0, generator)
        return averaged.model

    @torch.no_grad()
    def _reward(self, generated: Transitions) -> Tensor:
        """Line 9: ``[S, N]``."""
        reward: Tensor = self.rewards(generated).combined
        if self.config.policy_reward is PolicyReward.LOGIT:
            reward = reward - generated.log_prob
        return self._reference.charge(reward, generated, self.policies)

    def _collect(self, episodes: int, collector: Collector) -> Rollouts:
        rollouts = collector.collect(self.policies, episodes, self._rng)
        require_usable(rollouts, self.layout)
        self.environment_steps += rollouts.played_steps
        return rollouts

    def _transitions(self, rollouts: Rollouts) -> Transitions:
        """Rollouts as transitions that carry the log-density the discriminator is to use."""
        transitions = Transitions.of(
            torch.as_tensor(rollouts.observations),
            torch.as_tensor(rollouts.actions),
            torch.as_tensor(rollouts.log_probs),
            rollouts.acting,
        )
        return transitions.with_log_prob(self._density(transitions.log_prob, transitions.passive))

    @torch.no_grad()
    def _log_prob(self, transitions: Transitions) -> Tensor:
        """The current policies' log-density of ``[S, N]`` transitions, as the discriminator uses it."""
        if not self.config.discriminator.uses_log_prob:
            return torch.zeros_like(transitions.passive)
        distribution = self.policies.distribution(transitions.observation)
        log_prob = self.policies.log_prob(distribution, transitions.action)
        return self._density(log_prob, transitions.passive)

    @torch.no_grad()
    def _density(self, log_prob: Tensor, passive: Tensor) -> Tensor:
        log_std = self.policies.log_std if isinstance(self.policies, GaussianPolicies) else None
        return used_log_prob(log_prob, log_std, self.config.discriminator) * (1.0 - passive)

    def _negatives(
        self, latest: Transitions, shares: ReplayConfig, amount: int, generator: torch.Generator
    ) -> Negatives:
        """Transitions to tell the demonstrations from: latest, replayed, and of the cloning snapshots."""
        return Negatives.draw(
            latest, self._replay, self._snapshots, self._displacement, shares, amount, generator
        )

    def state_dict(self) -> dict[str, Any]:
        """Everything needed to go on exactly: weights, optimisers, replay, random generators."""
        return {
            "policies": self.policies.state_dict(),
            "rewards": self.rewards.state_dict(),
            "averaged": {
                "weights": self._averaged.model.state_dict(),
                "updates": self._averaged.updates,
                "columns": list(self.rewards.columns),
            },
            "training": self._training.state_dict(),
            "value": self._improvement.value.state_dict(),
            "replay": self._replay.state_dict(),
            "snapshots": None if self._snapshots is None else self._snapshots.packed,
            "torch_generator": self._generator.get_state(),
            "numpy_generator": self._rng.bit_generator.state,
            "reference": self._reference.state_dict() if self._reference.price else None,
            "iterations_done": self.iterations_done,
            "environment_steps": self.environment_steps,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take up a state of `state_dict`, of a trainer with the same configuration and data."""
        self.policies.load_state_dict(state["policies"])
        self.rewards.load_state_dict(state["rewards"])
        self._averaged.model.load_state_dict(state["averaged"]["weights"])
        self._averaged.updates = int(state["averaged"]["updates"])
        self._training.load_state_dict(state["training"])
        self._improvement.value.load_state_dict(state["value"])
        self._replay.load_state_dict(state["replay"])
        snapshots = state["snapshots"]
        widths = (len(self.layout.observation_names), len(self.layout.action_names))
        self._snapshots = None if snapshots is None else Transitions(snapshots, *widths)
        if self._reference.price:
            self._reference.load_state_dict(state["reference"])
        self._generator.set_state(state["torch_generator"])
        self._rng.bit_generator.state = state["numpy_generator"]
        self.iterations_done = int(state["iterations_done"])
        self.environment_steps = int(state["environment_steps"])
