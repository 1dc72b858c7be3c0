"""Learning the strokes: from episodes to rewards and policies, with any method.

The recipe that the trainer node and the table tennis study share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.contract.episode import (
    ACTING_STEPS,
    BALL_NAMES,
    FIRST_ACTING_STEP,
    PADDLE_NAMES,
    Episode,
    action_names,
)
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.checkpoints import export_policies
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Learner, Method, Problem
from msrd_ros.learning.methods import METHODS as ALL_METHODS
from msrd_ros.learning.methods.airl import AirlEachCross
from msrd_ros.learning.rollouts import BatchedCollector, Collector
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyVariation,
)
from msrd_ros.table_tennis.simulation.changes import AS_TAUGHT, find_change
from msrd_ros.table_tennis.strategies.table import Strategies, Strategy
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations
from msrd_ros.table_tennis.strokes.description import met_side
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies
from msrd_ros.table_tennis.strokes.presets import table_tennis, with_recovery_labels

METHODS: dict[str, Method] = {**ALL_METHODS, "airl": AirlEachCross()}
"""By name. One policy for all could not be told which stroke is wanted: here AIRL has a policy and a reward
for each."""
REWARD_GROUPS: dict[str, Callable[[Strategy], str]] = {
    "side_and_stroke": lambda strategy: str(strategy.label),
    "stroke": lambda strategy: strategy.stroke,
}
"""Whose a strategy reward is: every label's own, or shared by both sides of a stroke."""
POLICIES_FILE = "policies.safetensors"


@dataclass(frozen=True)
class StrokeTrainingConfig:
    """Settings of a training run.

    Attributes
    ----------
    method
        A name of `METHODS`.
    iterations, episodes
        Iterations over all strategies, and rollouts per strategy in each.
    seed
        Everything random follows from it.
    spread
        Of the feeds that are trained on; twice as wide as what is played, as nothing is lost there by it.
    ready_noise_rad, camera_noise_m, camera_latency_s
        Of the start posture and of what is seen of the ball, in training; the latency is the longest.
    threads
        Of the batched simulator.
    strategy_rewards
        Whose a strategy reward is, a key of `REWARD_GROUPS`.
    world
        Where the policies practise, a key of `changes.CHANGES` that the batched simulator knows.
    corrective_cloning
        Whether the policies start from cloning with injected joint offsets and labels that undo them, and to
        leave them has a price; otherwise they start from plain cloning and are free.
    cloning_steps
        Adam steps of cloning; None: as many as the recipe has.
    """

    method: str = "msrd"
    iterations: int = 30
    episodes: int = 200
    seed: int = 0
    spread: str = "twice"
    ready_noise_rad: float = 0.03
    camera_noise_m: float = 0.001
    camera_latency_s: float = 0.0
    threads: int = 2
    corrective_cloning: bool = True
    cloning_steps: int | None = None
    strategy_rewards: str = "side_and_stroke"
    world: str = AS_TAUGHT


def stroke_facts(
    episodes: Sequence[Episode],
    landing_points: Mapping[StrategyLabel, NDArray[np.float64]],
    strategies: Strategies,
) -> dict[StrategyLabel, StrokeFacts]:
    """What the episodes of each label say beside their motion, in the order of `strategies`.

    The side is the listed one, else where the episodes met the ball.
    """
    nowhere = np.full(2, np.nan)
    facts = {}
    for label in strategies.sort(episode.strategy for episode in episodes):
        own = [episode for episode in episodes if episode.label == label]
        pose = np.mean([episode.joint_position[0] for episode in own], axis=0)
        side = strategies.of(label).side or met_side(own)
        facts[label] = StrokeFacts(pose, landing_points.get(label, nowhere), side)
    return facts


def mean_landing_points(episodes: Sequence[Episode]) -> dict[StrategyLabel, NDArray[np.float64]]:
    """Where returned balls landed on average, (2,) in m, by label; only where that is known."""
    points: dict[StrategyLabel, list[tuple[float, float]]] = {}
    for episode in episodes:
        if episode.outcome is not None and episode.outcome.returned:
            point = episode.outcome.landing_x_m, episode.outcome.landing_y_m
            points.setdefault(episode.strategy, []).append(point)
    return {label: np.mean(found, axis=0) for label, found in points.items()}


def find_stroke_method(name: str) -> Method:
    """The method of that name.

    Raises
    ------
    UserError
        If there is none.
    """
    if name not in METHODS:
        raise UserError(f"method {name!r} is unknown; use one of {', '.join(METHODS)}")
    return METHODS[name]


def stroke_recipe(
    config: StrokeTrainingConfig,
    labels: Sequence[StrategyLabel],
    robot: Robot,
    strategies: Strategies | None = None,
) -> MSRDConfig:
    """Settings of MSRD on strokes of these labels by an arm; other methods' follow from them."""
    recipe = table_tennis(BALL_NAMES, PADDLE_NAMES)
    owned = _groups(config, labels, strategies or Strategies.shipped())
    groups = list(dict.fromkeys(owned))
    shared = tuple(map(groups.index, owned)) if len(groups) < len(owned) else ()
    recipe = replace(
        recipe,
        iterations=config.iterations,
        episodes=config.episodes,
        reward=replace(recipe.reward, reward_groups=shared),
    )
    if config.corrective_cloning:
        recipe = with_recovery_labels(recipe, robot.joint_names, action_names(robot))
    if config.cloning_steps is not None:
        recipe = replace(recipe, cloning=replace(recipe.cloning, steps=config.cloning_steps))
    return recipe


def _groups(
    config: StrokeTrainingConfig, labels: Sequence[StrategyLabel], strategies: Strategies
) -> list[str]:
    """Whose the strategy reward of each label is."""
    return [REWARD_GROUPS[config.strategy_rewards](strategies.of(label)) for label in labels]


class StrokeTraining:
    """One training run on demonstrated strokes.

    Parameters
    ----------
    episodes
        Demonstrations.
    landing_points
        Where they landed on average, (2,) in m by label; labels may be missing.
    config
        Settings.
    collector
        Where the policies are played; None takes the batched simulator.
    strategies
        What is known of them; None takes the package's table.
    method
        One of one's own; None takes that of `config`.

    Attributes
    ----------
    trainer
        The method at work.
    labels
        Strategies, in the order of all arrays.
    reward_groups
        Names of the strategy rewards, in their order.
    robot
        The arm that was taught, of N joints.
    strategies
        What is known of them.
    """

    def __init__(
        self,
        episodes: Sequence[Episode],
        landing_points: Mapping[StrategyLabel, NDArray[np.float64]],
        config: StrokeTrainingConfig,
        collector: Collector | None = None,
        strategies: Strategies | None = None,
        method: Method | None = None,
    ) -> None:
        self.config = config
        self.method = method or find_stroke_method(config.method)
        self.strategies = strategies or Strategies.shipped()
        shown = gather_demonstrations(episodes, self.strategies)
        self.robot = episodes[0].robot
        self.demonstrations = replace(shown, derived=PaddleColumns(self.robot))
        self._facts = stroke_facts(episodes, landing_points, self.strategies)
        self.labels = tuple(self._facts)
        self.reward_groups = tuple(dict.fromkeys(_groups(config, self.labels, self.strategies)))
        self.simulator = self._make_simulator(config.seed)
        self.trainer: Learner = self.method.start(
            Problem(
                stroke_recipe(config, self.labels, self.robot, self.strategies),
                self.demonstrations,
                collector or BatchedCollector(self.simulator),
                config.seed,
            )
        )

    def _reward_group(self, label: StrategyLabel) -> str:
        return REWARD_GROUPS[self.config.strategy_rewards](self.strategies.of(label))

    def _make_simulator(self, seed: int) -> KinematicRallies:
        config = self.config
        plans = [RallyPlan(facts.side, facts.ready_pose) for facts in self._facts.values()]
        variation = RallyVariation(
            SPREADS[config.spread], config.ready_noise_rad, config.camera_noise_m, config.camera_latency_s
        )
        usual = KinematicRalliesConfig(variation=variation, threads=config.threads, robot=self.robot)
        return KinematicRallies(plans, find_change(config.world).in_batch(usual))

    def policies(self, exploration_seed: int | None = None) -> StrokePolicies:
        """The present policies, as the executor plays them."""
        details = {
            "method": self.method.name,
            "seed": self.config.seed,
            "iterations": self.trainer.iterations_done,
        }
        exported = export_policies(self.trainer.policies, self.trainer.layout, details)
        return StrokePolicies(exported, self._facts, exploration_seed, robot=self.robot)

    def evaluate(
        self, balls: int, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Shares of struck and of returned balls, (S,) each, of the mean policies in the batched simulator.

        For the progress report only: rates that count are played in Bullet.
        """
        simulator = self._make_simulator(self.config.seed)
        BatchedCollector(simulator).collect(self.trainer.policies, balls, rng, deterministic=True)
        results = simulator.results()
        return results.struck.mean(axis=1), results.returned.mean(axis=1)

    def rewards_of(
        self, observations: NDArray[np.floating], strategy: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sums along trajectories of the learned rewards.

        Parameters
        ----------
        observations
            Shape (M, T + 1, N + 6).
        strategy
            Row whose network R0 is read next to; R0 is the same for all.

        Returns
        -------
        task
            R0 summed over each trajectory, shape (M,).
        strategies
            Every S_i summed over each trajectory, shape (S, M).
        """
        count, states = observations.shape[:2]
        steps = states - 1
        stacked = torch.as_tensor(observations, dtype=torch.float32)[None].expand(
            len(self.labels), -1, -1, -1
        )
        actions = torch.zeros(len(self.labels), count, min(ACTING_STEPS, steps), self.robot.joint_count)
        with torch.no_grad():
            values = self.trainer.averaged_rewards(Transitions.of(stacked, actions))
        task = values.task[strategy].reshape(count, steps).sum(dim=1)
        strategies = values.strategy.reshape(len(self.labels), count, steps).sum(dim=2)
        return task.double().numpy(), strategies.double().numpy()

    def strategy_matrix(self, episodes: Sequence[Episode]) -> NDArray[np.float64]:
        """Mean S_i (row) along the trajectories of those whose S_j is (column), rows normalised to [0, 1].

        Square, in the order of `reward_groups`.
        """
        owner_of = self._reward_group
        first = [[owner_of(label) for label in self.labels].index(owner) for owner in self.reward_groups]
        matrix = np.zeros((len(self.reward_groups), len(self.reward_groups)))
        for column, owner in enumerate(self.reward_groups):
            rows = [e.observations[FIRST_ACTING_STEP:] for e in episodes if owner_of(e.strategy) == owner]
            if rows:
                matrix[:, column] = self.rewards_of(np.stack(rows), 0)[1][first].mean(axis=1)
        low, high = matrix.min(axis=1, keepdims=True), matrix.max(axis=1, keepdims=True)
        scaled: NDArray[np.float64] = (matrix - low) / np.maximum(high - low, 1e-12)
        return scaled
