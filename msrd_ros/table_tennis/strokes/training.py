"""Learning the strokes: from episodes to rewards and policies, with MSRD or AIRL.

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
    Episode,
    action_names,
)
from msrd_ros.contract.labels import ALL_LABELS, StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.airl import airl_per_strategy
from msrd_ros.learning.checkpoints import export_policies
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.rollouts import BatchedCollector, Collector
from msrd_ros.learning.trajectories import Demonstrations, Transitions
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyVariation,
)
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.presets import table_tennis, with_recovery_labels

METHODS = ("msrd", "airl")
REWARD_GROUPS: dict[str, Callable[[StrategyLabel], str]] = {
    "side_and_stroke": str,
    "stroke": lambda label: label.stroke.value,
}
"""Whose a strategy reward is: every label's own, or shared by forehand and backhand of a stroke."""
POLICIES_FILE = "policies.safetensors"
RESULT_FILE = "training.json"


@dataclass(frozen=True)
class StrokeTrainingConfig:
    """Settings of a training run.

    Attributes
    ----------
    method
        ``msrd``, or ``airl`` for a reward of its own per strategy.
    iterations, episodes
        Iterations over all strategies, and rollouts per strategy in each.
    seed
        Everything random follows from it.
    spread
        Of the feeds that are trained on.
    ready_noise_rad, camera_noise_m, camera_latency_s
        Of the start posture and of what is seen of the ball, in training; the latency is the longest.
    threads
        Of the batched simulator.
    strategy_rewards
        Whose a strategy reward is, a key of `REWARD_GROUPS`.
    corrective_cloning
        Whether the policies start from cloning with injected joint offsets and labels that undo them, rather
        than from plain cloning.
    """

    method: str = "msrd"
    iterations: int = 80
    episodes: int = 200
    seed: int = 0
    spread: str = "standard"
    ready_noise_rad: float = 0.03
    camera_noise_m: float = 0.001
    camera_latency_s: float = 0.0
    threads: int = 2
    corrective_cloning: bool = False
    strategy_rewards: str = "side_and_stroke"


def gather_demonstrations(episodes: Sequence[Episode]) -> Demonstrations:
    """Episodes as the datasets D(1)..D(N), in the order of `ALL_LABELS`.

    Rows begin at `FIRST_ACTING_STEP`, where the policies begin to act.

    Raises
    ------
    UserError
        If there is no episode.
    """
    if not episodes:
        raise UserError("no demonstrations: record some, or give a folder of bags")
    by_label = {
        label: [episode for episode in episodes if episode.label == label]
        for label in ALL_LABELS
        if any(episode.label == label for episode in episodes)
    }
    most, robot = max(map(len, by_label.values())), episodes[0].robot
    horizon = len(episodes[0].joint_position) - 1 - FIRST_ACTING_STEP
    observations = np.zeros((len(by_label), most, horizon + 1, episodes[0].observations.shape[1]))
    actions = np.zeros((len(by_label), most, ACTING_STEPS, robot.joint_count))
    lengths = np.zeros((len(by_label), most), dtype=np.int64)
    for row, group in enumerate(by_label.values()):
        for column, episode in enumerate(group):
            observations[row, column] = episode.observations[FIRST_ACTING_STEP:]
            actions[row, column] = episode.actions[FIRST_ACTING_STEP : FIRST_ACTING_STEP + ACTING_STEPS]
            lengths[row, column] = horizon
    return Demonstrations(observations, actions, stroke_layout(robot, tuple(by_label)), lengths)


def ready_poses(episodes: Sequence[Episode]) -> dict[StrategyLabel, NDArray[np.float64]]:
    """Mean posture (N,) in rad in which the episodes of each label begin."""
    labels = dict.fromkeys(label for label in ALL_LABELS if any(e.label == label for e in episodes))
    return {
        label: np.mean([e.joint_position[0] for e in episodes if e.label == label], axis=0)
        for label in labels
    }


def mean_landing_points(episodes: Sequence[Episode]) -> dict[StrategyLabel, NDArray[np.float64]]:
    """Where returned balls landed on average, (2,) in m, by label; only where that is known."""
    points: dict[StrategyLabel, list[tuple[float, float]]] = {}
    for episode in episodes:
        if episode.outcome is not None and episode.outcome.returned:
            point = episode.outcome.landing_x_m, episode.outcome.landing_y_m
            points.setdefault(episode.label, []).append(point)
    return {label: np.mean(found, axis=0) for label, found in points.items()}


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

    Attributes
    ----------
    trainer
        MSRD or AIRL, at work.
    labels
        Strategies, in the order of all arrays.
    reward_groups
        Names of the strategy rewards, in their order.
    robot
        The arm that was taught, of N joints.
    """

    def __init__(
        self,
        episodes: Sequence[Episode],
        landing_points: Mapping[StrategyLabel, NDArray[np.float64]],
        config: StrokeTrainingConfig,
        collector: Collector | None = None,
    ) -> None:
        if config.method not in METHODS:
            raise UserError(f"method {config.method!r} is unknown; use one of {', '.join(METHODS)}")
        self.config = config
        self.demonstrations = gather_demonstrations(episodes)
        self.robot = episodes[0].robot
        poses = ready_poses(episodes)
        self.labels = tuple(poses)
        nowhere = np.full(2, np.nan)
        self._facts = {
            label: StrokeFacts(pose, landing_points.get(label, nowhere)) for label, pose in poses.items()
        }
        self.simulator = self._make_simulator(config.seed)
        settings = table_tennis(BALL_NAMES, self.robot.joint_names)
        owned = [REWARD_GROUPS[config.strategy_rewards](label) for label in self.labels]
        self.reward_groups = tuple(dict.fromkeys(owned))
        shared = (
            tuple(self.reward_groups.index(name) for name in owned)
            if len(self.reward_groups) < len(owned)
            else ()
        )
        settings = replace(
            settings,
            iterations=config.iterations,
            episodes=config.episodes,
            reward=replace(settings.reward, reward_groups=shared),
        )
        if config.corrective_cloning:
            settings = with_recovery_labels(settings, self.robot.joint_names, action_names(self.robot))
        make = MSRD if config.method == "msrd" else airl_per_strategy
        self.trainer = make(
            settings, self.demonstrations, collector or BatchedCollector(self.simulator), config.seed
        )

    def _make_simulator(self, seed: int) -> KinematicRallies:
        config = self.config
        plans = [RallyPlan(label.side, facts.ready_pose) for label, facts in self._facts.items()]
        variation = RallyVariation(
            SPREADS[config.spread], config.ready_noise_rad, config.camera_noise_m, config.camera_latency_s
        )
        return KinematicRallies(
            plans, KinematicRalliesConfig(variation=variation, threads=config.threads, robot=self.robot)
        )

    def policies(self, exploration_seed: int | None = None) -> StrokePolicies:
        """The present policies, as the executor plays them."""
        assert isinstance(self.trainer.policies, GaussianPolicies)
        details = {
            "method": self.config.method,
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
        owner_of = REWARD_GROUPS[self.config.strategy_rewards]
        first = [[owner_of(label) for label in self.labels].index(owner) for owner in self.reward_groups]
        matrix = np.zeros((len(self.reward_groups), len(self.reward_groups)))
        for column, owner in enumerate(self.reward_groups):
            rows = [e.observations[FIRST_ACTING_STEP:] for e in episodes if owner_of(e.label) == owner]
            if rows:
                matrix[:, column] = self.rewards_of(np.stack(rows), 0)[1][first].mean(axis=1)
        low, high = matrix.min(axis=1, keepdims=True), matrix.max(axis=1, keepdims=True)
        scaled: NDArray[np.float64] = (matrix - low) / np.maximum(high - low, 1e-12)
        return scaled
