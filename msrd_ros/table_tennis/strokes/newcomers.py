"""One more teacher of strokes: recognised, and played after a recording or a few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, FIRST_ACTING_STEP, Episode, action_names
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.newcomers.arrivals import MOST_SHOWN
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.newcomers import Meeting, Newcomers
from msrd_ros.learning.newcomers.one_policy import fit_policy
from msrd_ros.learning.policy import Policy
from msrd_ros.learning.rewards import RewardForm, RewardModel
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Demonstrations, Rollouts
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyVariation,
)
from msrd_ros.table_tennis.strategies.table import Side, Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations
from msrd_ros.table_tennis.strokes.description import met_side
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies
from msrd_ros.table_tennis.strokes.presets import with_recovery_labels
from msrd_ros.table_tennis.strokes.training import (
    StrokeTraining,
    StrokeTrainingConfig,
    mean_landing_points,
    stroke_recipe,
)
from msrd_ros.table_tennis.strokes.transfer import depart, departing_rates, departure_of, nearest_weights

Array = NDArray[np.float64]

BALLS = 24
"""Of known strokes, that a newcomer's are transferred to."""
SHARES = (1.0, 0.75, 0.5, 0.25)
"""Of what a recording departs from the known strokes, that may be learned: it holds slips as well."""
SHARE_EPISODES = 20
LEAST_GOOD = 0.95
"""Share of episodes that have to be as good for the task as known demonstrations."""
_WORST = 0.02
"""Quantile of known demonstrations' task reward that counts as good."""


@dataclass
class MixedStrokes:
    """Plays mixtures in the batched simulator: a `Collector` of one policy, from its own ready pose.

    Attributes
    ----------
    facts
        By strategy; newcomers are added.
    robot, config
        The arm, and what feeds, start postures and camera are like.
    """

    facts: dict[StrategyLabel, StrokeFacts]
    robot: Robot
    config: StrokeTrainingConfig

    def ready_pose(self, policy: MixedPolicy) -> Array:
        """Where a mixture waits: the mean of where its parts do, ``[N]``, rad."""
        each = [weight * self.facts[StrategyLabel(part.label)].ready_pose for weight, part in policy.parts]
        return np.asarray(np.sum(each, axis=0))

    def collect(self, policy: MixedPolicy, episodes: int, rng: np.random.Generator) -> Rollouts:
        """Play `episodes` strokes."""
        simulator = self._simulator(policy, self.ready_pose(policy))
        return BatchedCollector(simulator).collect(policy, episodes, rng)  # type: ignore[arg-type]

    def play_departing(
        self, policy: MixedPolicy, departure: Array, episodes: int, rng: np.random.Generator
    ) -> Array:
        """Observations ``[K, T+1, N+6]`` of strokes that depart from a mixture; see `depart`."""
        joints, rates = self.robot.joint_count, departing_rates(self.robot, departure)
        simulator = self._simulator(policy, self.ready_pose(policy) + departure[0])
        seen = [simulator.reset(1, episodes, rng)]
        for step in range(simulator.horizon):
            action = np.zeros((1, episodes, joints))
            if step < len(rates):
                there = seen[-1].copy()
                there[..., :joints] -= departure[step]
                action = np.clip(policy.mean(there), -1.0, 1.0) + rates[step]
            seen.append(simulator.step(action))
        return np.asarray(np.stack(seen, axis=2)[0])

    def _simulator(self, policy: MixedPolicy, ready_pose: Array) -> KinematicRallies:
        config = self.config
        variation = RallyVariation(
            SPREADS[config.spread], config.ready_noise_rad, config.camera_noise_m, config.camera_latency_s
        )
        side = self.facts[StrategyLabel(policy.parts[0][1].label)].side
        return KinematicRallies(
            [RallyPlan(side, ready_pose)],
            KinematicRalliesConfig(variation=variation, threads=1, robot=self.robot),
        )


class StrokeNewcomers(Newcomers):
    """Learned strokes that teachers are added to.

    Parameters
    ----------
    policies
        Those that are known.
    rewards
        R0 and S_i in the policies' order; None: policies alone are learned.
    episodes
        What was learned of.
    config
        Of the training.
    strategies
        What is known of them; None takes the package's table.

    Raises
    ------
    UserError
        If the strokes are not of the policies' strategies, or too few, or the policies take a target.
    """

    def __init__(
        self,
        policies: StrokePolicies,
        rewards: RewardModel | None,
        episodes: Sequence[Episode],
        config: StrokeTrainingConfig | None = None,
        strategies: Strategies | None = None,
    ) -> None:
        config = config or StrokeTrainingConfig()
        self.robot = policies.robot
        if policies.takes_target:
            raise UserError("newcomers take no target, and these policies do; give those before `aim`")
        demonstrations = gather_demonstrations(episodes, strategies or Strategies.shipped())
        if demonstrations.layout.labels != policies.policies.layout.labels:
            raise UserError(
                f"newcomers: the policies are of {', '.join(policies.policies.layout.labels)}, the strokes "
                f"of {', '.join(demonstrations.layout.labels)}; give those that they were learned from"
            )
        recipe = with_recovery_labels(
            stroke_recipe(config, policies.labels, self.robot, strategies),
            self.robot.joint_names,
            action_names(self.robot),
        )
        self._trained = len(policies.labels)
        self._ground = MixedStrokes(dict(policies.facts), self.robot, config)
        self._arriving: StrokeFacts | None = None
        self._recorded: dict[str, list[Episode]] = {}
        ordered = [e for label in policies.labels for e in episodes if e.label == label]
        super().__init__(
            Learned(policies.policies, rewards, {"method": config.method}),
            demonstrations,
            self._ground,
            recipe,
            [episode.subject or episode.source for episode in ordered],
            config.seed,
        )
        self._good = {} if rewards is None else self._good_enough(ordered)
        self._balls = {
            side: np.stack([_shown(e)[:, self.robot.joint_count :] for e in ordered if met_side([e]) is side])
            for side in {met_side([episode]) for episode in ordered}
        }

    @classmethod
    def of_training(cls, training: StrokeTraining, episodes: Sequence[Episode]) -> StrokeNewcomers:
        """From a run that is over, with the strokes that it learned from.

        Where its method does not part R0 from S_i, newcomers get policies and no rewards.
        """
        rewards = training.trainer.averaged_rewards if training.method.has_rewards else None
        if rewards is not None and rewards.form is not RewardForm.TWO_COLUMN:
            rewards = None
        return cls(training.policies(), rewards, episodes, training.config, training.strategies)

    @property
    def stroke_policies(self) -> StrokePolicies:
        """All that can be played now."""
        facts = {
            StrategyLabel(label): self._ground.facts[StrategyLabel(label)]
            for label in self.policies.layout.labels
        }
        return StrokePolicies(self.policies, facts, robot=self.robot)

    def meet_strokes(self, episodes: Sequence[Episode], name: StrategyLabel | None = None) -> Meeting:
        """See `meet`: recognise recorded strokes of one teacher, and have them played.

        Raises
        ------
        UserError
            If they are of another arm, on both sides, or on one that nobody plays.
        """
        for episode in episodes:
            self.robot.require(episode.robot.identity, episode.source)
        sides = {met_side([episode]) for episode in episodes}
        if len(sides) != 1:
            raise UserError(f"newcomer: {len(sides)} sides are shown; give strokes of one side at a time")
        side = sides.pop()
        if side not in self._balls:
            raise UserError(f"newcomer: no known strategy plays {side}; learn one there first")
        together = [*self._recorded.get(name, ()), *episodes][-MOST_SHOWN:] if name else list(episodes)
        pose = np.mean([episode.joint_position[0] for episode in together], axis=0)
        landings = list(mean_landing_points([replace(e, label=_ANY) for e in together]).values())
        self._arriving = StrokeFacts(pose, landings[0] if landings else np.full(2, np.nan), side)
        acting = slice(FIRST_ACTING_STEP, FIRST_ACTING_STEP + ACTING_STEPS)
        met = self.meet(
            [_shown(episode) for episode in episodes], [episode.actions[acting] for episode in episodes], name
        )
        self._recorded[met.name] = together
        return met

    def may_mix(self, first: str, second: str) -> bool:
        """Strokes of one side alone."""
        facts = self._ground.facts
        return facts[StrategyLabel(first)].side is facts[StrategyLabel(second)].side

    def _policy_of(
        self, name: str, weights: dict[str, float], observations: Array, actions: Array, is_mixture: bool
    ) -> Policy:
        """Correctively cloned from the recordings and from what they say of other balls; see `transfer`."""
        assert self._arriving is not None
        facts = self._ground.facts[StrategyLabel(name)] = self._arriving
        # However it was recognised: from where the motion is nearest the way to it is shortest.
        near = nearest_weights(self._on_side(facts.side), observations, actions)
        base = self._mixed(near)
        balls = self._balls[facts.side]
        chosen = self._rng.permutation(len(balls))[:BALLS]
        ready_pose = self._ground.ready_pose(base)
        departure = departure_of(self.robot, base.mean, ready_pose, observations)
        share = self._share(base, departure, facts.side)
        motions = depart(self.robot, base.mean, ready_pose, share * departure, balls[chosen])
        self._ground.facts[StrategyLabel(name)] = replace(facts, ready_pose=ready_pose + share * departure[0])
        if share < 1.0:
            observations, actions = observations[:0], actions[:0]
        shown = Demonstrations(
            np.concatenate([observations, motions.observations])[None],
            np.concatenate([actions, motions.actions])[None],
            replace(self.learned.layout, labels=(name,)),
        )
        start = self.policies.policy(max(near, key=lambda part: near[part]))
        return fit_policy(start, shown, replace(self.config.cloning, snapshots=()), self._generator)

    def _share(self, base: MixedPolicy, departure: Array, side: Side) -> float:
        """The largest share of a departure with which the task is still done as R0 knows it, played to see.

        A recording holds what its teacher means and what went a little wrong. What all teachers want is
        known; so far as the way there spoils it, the departure is a slip. Without rewards all is learned.
        """
        if side not in self._good:
            return 1.0
        for share in SHARES:
            seen = self._ground.play_departing(base, share * departure, SHARE_EPISODES, self._rng)
            self.episodes_played += SHARE_EPISODES
            if (self._task_reward(seen) >= self._good[side]).mean() >= LEAST_GOOD:
                return share
        return SHARES[-1]

    def _task_reward(self, observations: Array) -> Array:
        """Mean R0 of trajectories ``[K, T+1, N+6]``, ``[K]``."""
        return np.asarray(self.learned.task_reward(observations[:, 1:]).mean(axis=1))

    def _good_enough(self, episodes: Sequence[Episode]) -> dict[Side, float]:
        """By side, the mean R0 of the worst known demonstrations that count as good."""
        by_side: dict[Side, list[Episode]] = {}
        for episode in episodes:
            by_side.setdefault(met_side([episode]), []).append(episode)
        return {
            side: float(np.quantile(self._task_reward(np.stack([_shown(e) for e in own])), _WORST))
            for side, own in by_side.items()
        }

    def _on_side(self, side: Side) -> list[Policy]:
        """Policies of the strategies that were trained and play that side."""
        names = self.policies.layout.labels[: self._trained]
        return [
            self.policies.policy(name)
            for name in names
            if self._ground.facts[StrategyLabel(name)].side is side
        ]


_ANY = StrategyLabel("any")


def _shown(episode: Episode) -> Array:
    """Observations from the first acting step on."""
    return episode.observations[FIRST_ACTING_STEP:]
