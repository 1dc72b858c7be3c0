"""Strokes that learn to land where they are told: goal-conditioned supervised learning with hindsight labels.

Policies play in the batched simulator; each rollout is repeated with small offsets of its actions until its
ball lands near a target (`corrected_rollouts`), and is then labelled with where its ball did land, as in
hindsight experience replay (Andrychowicz et al. 2017) and goal-conditioned supervised learning (Ghosh et al.
2021). Policies that see the target beside the rest are cloned from these rollouts, with corrective noise.
While they learn, the referee says where balls landed; while they play, nobody does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from msrd_ros.contract.episode import ACTING_STEPS, BALL_NAMES, CONTROL_PERIOD_S, action_names
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.checkpoints import export_policies
from msrd_ros.learning.cloning import CloningConfig, clone
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.strokes.batched_play import batch_policy, land_near, make_simulator, play_batch
from msrd_ros.table_tennis.strokes.corrected_rollouts import (
    Corrected,
    CorrectionConfig,
    Feeds,
    RepeatedRallies,
    correct,
    fit_response,
)
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.reach import Reach

Array = NDArray[np.float64]

GRID_X_M = tuple(np.linspace(0.30, 1.20, 9).tolist())
GRID_Y_M = tuple(np.linspace(-0.55, 0.55, 9).tolist())
"""Targets that are tried: up to the smaller margin that a ball of 20 cm of scatter has on the table."""
LEARNING_RATES = 3e-3, 3e-4
"""Cloning goes on at a tenth of the rate: the noise of the last steps is centimetres here."""
AIMING_STREAM, REACH_STREAM = 0xA1A, 0x7EAC4
RECOVERY_RAD, RECOVERY_GAIN = 0.03, 3.0
"""Joint offsets while cloning, and the speed fractions a radian that undo them. With 6, as `presets` have it,
landings come less near in as many steps."""
LOOK_EVERY = 100
"""Steps of cloning between two calls of `look`."""
LEAST_RETURNED = 0.5
"""Of the balls of each strategy, for its rollouts to show how landings follow what is done."""
HIT_M = 0.10
"""From its target a repeated rollout is told of as there."""
NEAR_M, ABOUT_M = 0.20, 0.30
"""Distances from a target that are judged."""


@dataclass(frozen=True)
class AimingConfig:
    """Settings of learning targets.

    Attributes
    ----------
    rollouts
        Rollouts of each strategy.
    home_share
        Of their targets, this share lies about the teacher's mean point.
    margin_m
        How far targets lie beyond the grid that is tried in the end.
    hidden
        Widths of the policies' hidden layers.
    cloning_steps, batch
        Adam steps at each learning rate, each on so many transitions of every strategy.
    reach_balls
        Balls to each target of the grid, by which it is taken for in reach or not.
    near_least, about_least
        Shares of these balls, with their neighbours' in the grid, that land within 20 and 30 cm of a target
        in reach.
    seed, spread, ready_noise_rad, camera_noise_m, threads
        As of `StrokeTrainingConfig`.
    correction
        Of the repetitions.
    """

    rollouts: int = 1000
    home_share: float = 0.1
    margin_m: float = 0.1
    hidden: tuple[int, ...] = (64, 64)
    cloning_steps: int = 2000
    batch: int = 512
    reach_balls: int = 40
    near_least: float = 0.80
    about_least: float = 0.92
    seed: int = 0
    spread: str = "standard"
    ready_noise_rad: float = 0.03
    camera_noise_m: float = 0.001
    threads: int = 2
    correction: CorrectionConfig = field(default_factory=CorrectionConfig)

    @property
    def variation(self) -> RallyVariation:
        """How balls, start postures and what is seen of them vary."""
        return RallyVariation(SPREADS[self.spread], self.ready_noise_rad, self.camera_noise_m)


def aim(
    policies: StrokePolicies,
    config: AimingConfig | None = None,
    tell: Callable[[str], None] = lambda _: None,
    look: Callable[[], None] = lambda: None,
) -> StrokePolicies:
    """Policies that do what these do, and land where they are told.

    Without a target they land at the teacher's mean point; where that is not known, at their own.

    Parameters
    ----------
    policies
        With or without a target as an input.
    config
        Settings.
    tell
        Takes a line before and after each part.
    look
        Called every few seconds; what it raises ends the work.

    Raises
    ------
    UserError
        If a strategy returns too few balls to learn from.
    """
    return _Aiming(policies, config or AimingConfig(), tell, look).run()


class _Aiming:
    """One run of learning targets."""

    def __init__(
        self,
        policies: StrokePolicies,
        config: AimingConfig,
        tell: Callable[[str], None],
        look: Callable[[], None],
    ) -> None:
        self._config, self._tell, self._look = config, tell, look
        self._rng = np.random.default_rng((AIMING_STREAM, config.seed))
        self._generator = torch.Generator().manual_seed(config.seed)
        self._policies = policies
        # Repetitions see exactly: what is done again is to end as it did, but for the offsets.
        exact = replace(config.variation, camera_noise_m=0.0)
        self._simulator = make_simulator(policies, exact, config.threads)
        self._layout = stroke_layout(policies.robot, policies.labels, takes_target=True)

    def run(self) -> StrokePolicies:
        """All rounds, then the reach."""
        self._policies = replace(self._policies, facts=self._with_landing_points())
        targets = self._draw_targets()
        self._tell(f"repeating {targets.shape[1]} rollouts of each strategy until they land at targets")
        rollouts = self._gather(targets)
        apart = np.linalg.norm(rollouts.landed.landing - targets, axis=-1)
        self._tell(f"{np.mean(apart < HIT_M):.0%} landed within {100 * HIT_M:g} cm of them; cloning them")
        self._policies = self._learn(rollouts)
        self._tell("trying all targets")
        return self._with_reach()

    def _with_landing_points(self) -> dict[StrategyLabel, StrokeFacts]:
        """Where balls land without a target: where the teacher's did, else where these policies' do."""
        facts = dict(self._policies.facts)
        home = np.array([np.nan_to_num(known.landing_point) for known in facts.values()])
        targets = np.repeat(home[:, None], self._config.rollouts, axis=1)
        results, _ = play_batch(
            self._policies, targets, self._config.variation, self._rng, self._config.threads
        )
        for row, (label, known) in enumerate(facts.items()):
            back = results.returned[row]
            if back.mean() < LEAST_RETURNED:
                raise UserError(
                    f"{label} returns {back.mean():.0%} of its balls; to learn targets from them it takes "
                    f"{LEAST_RETURNED:.0%}: train it longer, or leave it out"
                )
            if not np.isfinite(known.landing_point).all():
                facts[label] = replace(known, landing_point=results.landing[row, back].mean(axis=0))
        return facts

    def _gather(self, targets: Array) -> Corrected:
        """Rollouts that land at `targets` (S, K, 2), or nearer to them than they did."""
        policies, config = self._policies, self._config.correction
        act = batch_policy(policies, targets)
        rallies = RepeatedRallies(self._simulator, self._draw_feeds(), config)
        response = fit_response(rallies, act, config, self._rng)
        rallies = RepeatedRallies(self._simulator, self._draw_feeds(), config)
        return correct(rallies, act, targets, response, config, self._rng, self._look)

    def _draw_targets(self) -> Array:
        """Targets over the grid and a little beyond, (S, K, 2); some about the teacher's mean point."""
        config, count = self._config, self._config.rollouts
        margin = config.margin_m
        low = np.array([GRID_X_M[0], GRID_Y_M[0]]) - margin
        high = np.array([GRID_X_M[-1], GRID_Y_M[-1]]) + margin
        targets = self._rng.uniform(low, high, (len(self._policies.facts), count, 2))
        home = round(config.home_share * count)
        for row, known in enumerate(self._policies.facts.values()):
            targets[row, :home] = known.landing_point + 0.05 * self._rng.standard_normal((home, 2))
        return targets

    def _draw_feeds(self) -> Feeds:
        simulator, config, limits = self._simulator, self._config, self._policies.robot.limits
        balls, ready = [], []
        for plan in simulator.plans:
            spread = simulator.config.variation.feed_spread
            balls.append(simulator.config.feeder.sample_states(plan.side, spread, config.rollouts, self._rng))
            offset = self._rng.standard_normal((config.rollouts, len(plan.ready_position)))
            ready.append(plan.ready_position + config.ready_noise_rad * offset)
        return Feeds(np.stack(balls), np.clip(ready, limits.lowest_rad, limits.highest_rad))

    def _learn(self, rollouts: Corrected) -> StrokePolicies:
        """Clone rollouts with the right spin, labelled with where they landed."""
        policies, layout = self._policies, self._layout
        landed, rollout = rollouts.landed, rollouts.rollout
        right = landed.returned & rollouts.keeps_spin
        steps = rollout.observations.shape[2]
        labels = np.repeat(np.nan_to_num(landed.landing)[:, :, None], steps, axis=2)
        seen = np.concatenate([rollout.observations, labels.astype(np.float32)], axis=-1)
        lengths = np.where(right, ACTING_STEPS, 0)
        demonstrations = Demonstrations(seen, rollout.actions, layout, lengths)
        network = self._fresh(seen[right])
        pool, names = DemonstrationPool(demonstrations), (layout.observation_names, layout.action_names)
        for learning_rate in LEARNING_RATES:
            clone(network, pool, *names, self._cloning(learning_rate), self._generator, self._look)
        exported = export_policies(network, layout, policies.policies.details)
        # Cloning leaves it as it is: how far these policies explore.
        exported.tensors["log_std"] = policies.policies.tensors["log_std"]
        return replace(policies, policies=exported)

    def _fresh(self, seen: NDArray[np.float32]) -> GaussianPolicies:
        """Policies that know nothing yet; inputs are scaled by what was `seen` (n, T + 1, N + 8)."""
        columns = seen.reshape(-1, seen.shape[-1]).astype(np.float64)
        offset, scale = columns.mean(axis=0), np.maximum(columns.std(axis=0), 1e-3)
        features = Features(tuple(range(len(offset))), tuple(offset.tolist()), tuple(scale.tolist()))
        strategies, actions = len(self._layout.labels), len(self._layout.action_names)
        return GaussianPolicies(
            strategies, features, actions, self._config.hidden, 0.0, -20.0, 5.0, self._generator
        )

    def _cloning(self, learning_rate: float) -> CloningConfig:
        """Corrective noise on the joints, and the camera's noise on what is seen of the ball."""
        robot, noise_m = self._policies.robot, self._config.camera_noise_m
        from_samples = 2.0**0.5 / CONTROL_PERIOD_S
        ball = [(name, noise_m * (1.0 if axis < 3 else from_samples)) for axis, name in enumerate(BALL_NAMES)]
        joints = zip(robot.joint_names, action_names(robot), strict=True)
        return CloningConfig(
            steps=self._config.cloning_steps,
            batch=self._config.batch,
            learning_rate=learning_rate,
            snapshots=tuple(range(0, self._config.cloning_steps, LOOK_EVERY)),
            state_noise=(*((name, RECOVERY_RAD) for name in robot.joint_names), *ball),
            recovery_labels=tuple((joint, action, RECOVERY_GAIN) for joint, action in joints),
        )

    def _with_reach(self) -> StrokePolicies:
        """Try every target of the grid on feeds that nothing was learned from."""
        policies, config = self._policies, self._config
        empty = Reach.grid(GRID_X_M, GRID_Y_M)
        targets = np.repeat(empty.points, config.reach_balls, axis=0)
        targets = np.broadcast_to(targets, (len(policies.facts), *targets.shape))
        rng = np.random.default_rng((REACH_STREAM, config.seed))
        results, _ = play_batch(policies, targets, config.variation, rng, config.threads)
        shape = (len(policies.facts), *empty.hits.shape, config.reach_balls)
        hits = np.ones(shape[:-1], dtype=np.bool_)
        for distance_m, least in ((NEAR_M, config.near_least), (ABOUT_M, config.about_least)):
            near = land_near(results, targets, distance_m).reshape(shape).mean(axis=-1)
            hits &= uniform_filter(near, size=(1, 3, 3), mode="nearest") >= least
        facts = {
            label: replace(known, reach=replace(empty, hits=hits[row]))
            for row, (label, known) in enumerate(policies.facts.items())
        }
        return replace(policies, facts=facts)
