"""Configuration of MSRD and its relatives, as data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.derived import DerivedColumns
from msrd_ros.learning.discriminator import Penalty
from msrd_ros.learning.networks import Features
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig


class TaskUpdate(StrEnum):
    """When R0 is stepped."""

    SUMMED = "summed"
    """Once for all strategies, with the mean of their gradients (the paper's "postponed" update)."""
    SEQUENTIAL = "sequential"
    """After every strategy, as Algorithm 1 is printed."""


class PolicyReward(StrEnum):
    """What the policies are rewarded with."""

    REWARD = "reward"
    """R_i(s, a) (Algorithm 1, line 9); entropy only through TRPO's bonus."""
    LOGIT = "logit"
    """R_i - log pi_i(a|s): the maximum-entropy objective itself, sampled."""


@dataclass(frozen=True)
class FeatureConfig:
    """Which observation columns a network sees, and how they are scaled.

    Attributes
    ----------
    names
        Columns by name; empty means all.
    scales
        Fixed scales, one per column, with offset 0; empty means mean and deviation of the demonstrations.
    """

    names: tuple[str, ...] = ()
    scales: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.names and self.scales and len(self.scales) != len(self.names):
            raise UserError(
                f"features: {len(self.scales)} scales for {len(self.names)} columns; give one each"
            )

    def build(self, demonstrations: Demonstrations, derived: DerivedColumns | None = None) -> Features:
        """Resolve names and scaling against `demonstrations`.

        Parameters
        ----------
        derived
            What may be named beside the observed columns; None: nothing.

        Raises
        ------
        UserError
            If a name is unknown or the number of scales is wrong.
        """
        known = demonstrations.layout.observation_names
        names = self.names or known
        columns = known if derived is None else (*known, *derived.names)
        unknown = [name for name in names if name not in columns]
        if unknown:
            raise UserError(f"features: no observation column {unknown[0]!r}; there are {', '.join(columns)}")
        indices = tuple(columns.index(name) for name in names)
        if self.scales:
            if len(self.scales) != len(names):
                raise UserError(
                    f"features: {len(self.scales)} scales for {len(names)} columns; give one each"
                )
            return Features(indices, (0.0,) * len(names), self.scales)
        steps = np.arange(demonstrations.horizon + 1)
        valid = steps <= demonstrations.step_counts()[..., None]
        valid &= demonstrations.step_counts()[..., None] > 0
        observed = np.asarray(demonstrations.observations, dtype=np.float64)
        if derived is not None and max(indices) >= len(known):
            observed = np.concatenate([observed, _derive_along(derived, observed)], axis=-1)
        seen = observed[valid][:, list(indices)]
        deviation = np.maximum(seen.std(axis=0), 1e-3 * max(1e-3, float(seen.std(axis=0).max())))
        return Features(indices, tuple(seen.mean(axis=0).tolist()), tuple(deviation.tolist()))


def _derive_along(derived: DerivedColumns, observed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derived columns ``[S, M, T+1, D]`` of trajectories; the first state is taken to come from itself."""
    after = torch.as_tensor(np.nan_to_num(observed), dtype=torch.float32)
    before = torch.cat([after[:, :, :1], after[:, :, :-1]], dim=2)
    return np.asarray(derived(before, after), dtype=np.float64)


@dataclass(frozen=True)
class RewardConfig:
    """Reward networks (paper, Section 4.2).

    Attributes
    ----------
    form
        Composition of R_i.
    hidden
        Widths of the hidden layers of R0 and S_i.
    alpha
        Weight alpha_i of S_i in R_i: one value, or one per strategy.
    task_features, strategy_features
        What R0 and S_i see of the next observation, and of what can be derived from a transition
        (`Demonstrations.derived`).
    sees_action
        Whether rewards are R(s, a) rather than R(s).
    shaping
        Whether to add AIRL's potential h_i.
    nearness
        Weight at the start, learned from there, of ``-log(1 + d^2)`` in R0 (see `Nearness`), which its
        network corrects: where data end a tanh network levels off anywhere, and with this R0 goes on
        falling. 0 is the paper.
    reward_groups
        Which strategy-only reward each strategy has, counted from 0; empty: each has its own.
    """

    form: RewardForm = RewardForm.TWO_COLUMN
    hidden: tuple[int, ...] = (32, 32)
    alpha: float | tuple[float, ...] = 1.0
    task_features: FeatureConfig = field(default_factory=FeatureConfig)
    strategy_features: FeatureConfig = field(default_factory=FeatureConfig)
    sees_action: bool = False
    shaping: bool = False
    nearness: float = 0.0
    reward_groups: tuple[int, ...] = ()


@dataclass(frozen=True)
class DiscriminatorConfig:
    """Training of the rewards (Algorithm 1, line 8).

    Attributes
    ----------
    steps, first_steps
        Adam steps an iteration, and further ones in the first iteration.
    batch
        Demonstration and generator transitions per strategy and step.
    demonstrations_per_iteration
        K of line 7: demonstrations drawn anew each iteration; None uses all.
    learning_rate, learning_rate_end, weight_decay
        Adam; the rate falls linearly to the given share over the planned iterations.
    penalty, penalty_weight
        Regulariser of S_i and lambda_i; None sets lambda_i = alpha_i, the paper's text.
    penalty_above
        Factor on the regulariser of positive S_i: 1 (the paper) makes R0 the mean of what strategies want,
        more moves it towards what any of them wants, so that S_i says what i forgoes.
    task_penalty_weight
        lambda_0 of E[R0^2], over the other strategies' transitions as well where there are cross-negatives
        (0 is the paper; the authors' code has one). Where generators pile up and demonstrations never go,
        the likelihood ratio and with it R0 falls without end: this says that it need not. AIRL per strategy
        has it on R_i.
    penalise_all
        Whether the regulariser's expectation also runs over the other strategies' transitions.
    cross_weight, cross_batch, cross_demonstrations
        Cross-negatives: weight (0 is the paper), number per strategy and step, and the share of them that
        are demonstrations rather than generator samples.
    cross_reaches_task
        Whether their gradient also flows into R0.
    gradient_penalty, task_gradient_penalty
        Weights of |grad S_i|^2 and |grad R0|^2.
    task_update
        When R0 is stepped.
    uses_log_prob
        Whether the logit carries log pi (AIRL) or is f alone.
    centre_log_prob
        Whether log pi is taken relative to its mean -H(pi), so that steps in which nobody acts
        (log pi = 0) and steps in which a policy acts meet at the same level.
    log_prob_bounds
        log pi is clipped to these (after centring).
    ema_rate
        Rate of the exponential moving average of the weights that is reported, per Adam step.
    """

    steps: int = 10
    first_steps: int = 0
    batch: int = 256
    demonstrations_per_iteration: int | None = None
    learning_rate: float = 1e-3
    learning_rate_end: float = 0.1
    weight_decay: float = 1e-4
    penalty: Penalty = Penalty.SQUARE
    penalty_weight: float | None = 0.01
    penalty_above: float = 1.0
    task_penalty_weight: float = 0.0
    penalise_all: bool = False
    cross_weight: float = 0.0
    cross_batch: int = 256
    cross_demonstrations: float = 0.5
    cross_reaches_task: bool = True
    gradient_penalty: float = 0.0
    task_gradient_penalty: float = 0.0
    task_update: TaskUpdate = TaskUpdate.SUMMED
    uses_log_prob: bool = True
    centre_log_prob: bool = False
    log_prob_bounds: tuple[float, float] = (-20.0, 20.0)
    ema_rate: float = 0.01


@dataclass(frozen=True)
class ReplayConfig:
    """Where negatives come from.

    Attributes
    ----------
    keep, iterations
        Transitions kept of each strategy and iteration, and for how many iterations.
    replay_share, snapshot_share
        Shares of a batch drawn from past iterations and from rollouts of the cloning snapshots; the rest is
        from the latest rollouts.
    displaced_share
        Share of all of them whose next state is a demonstrated one with a random offset instead (see
        `Displacement`): R0 and S_i learn that places which nobody shows are worth little (0 is the paper).
    """

    keep: int = 256
    iterations: int = 1000
    replay_share: float = 0.0
    snapshot_share: float = 0.0
    displaced_share: float = 0.0


@dataclass(frozen=True)
class RefitConfig:
    """Settings of `MSRD.refit_on_replay`.

    Attributes
    ----------
    steps
        Adam steps.
    negatives
        Where they come from: the shares.
    ema_rate
        Of the moving average of the weights.
    """

    steps: int = 600
    negatives: ReplayConfig = field(
        default_factory=lambda: ReplayConfig(replay_share=0.6, snapshot_share=0.4)
    )
    ema_rate: float = 0.003


@dataclass(frozen=True)
class PolicyConfig:
    """Gaussian policies.

    Attributes
    ----------
    hidden
        Widths of the hidden layers.
    std, std_min, std_max
        Standard deviation at the start, and its bounds.
    reference_price
        What a nat away from the policies that cloning left costs (see `ReferencePolicy`; 0 is the paper).
    features
        What policies and value functions see.
    """

    hidden: tuple[int, ...] = (32, 32)
    std: float = 0.2
    std_min: float = 0.1
    std_max: float = 1.0
    reference_price: float = 0.0
    features: FeatureConfig = field(default_factory=FeatureConfig)


@dataclass(frozen=True)
class MSRDConfig:
    """Everything about a training run but its data and its seed.

    Attributes
    ----------
    iterations
        Planned iterations, for the learning-rate schedule.
    episodes
        K of Algorithm 1, line 6: rollouts per strategy and iteration.
    discount, gae_decay
        gamma and lambda of the advantages.
    policy_reward
        What the policies are rewarded with.
    """

    iterations: int = 250
    episodes: int = 4
    discount: float = 0.99
    gae_decay: float = 0.97
    policy_reward: PolicyReward = PolicyReward.REWARD
    reward: RewardConfig = field(default_factory=RewardConfig)
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)
    replay: ReplayConfig = field(default_factory=ReplayConfig)
    policy: PolicyConfig = field(default_factory=PolicyConfig)
    trust_region: TrustRegionConfig = field(default_factory=TrustRegionConfig)
    value: ValueConfig = field(default_factory=ValueConfig)
    cloning: CloningConfig = field(default_factory=CloningConfig)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)
