"""Task reward R0, strategy-only rewards S_i, and their sum R_i (paper, Equation 4)."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import cast

import torch
from torch import Tensor, nn

from msrd_ros.core.errors import UserError
from msrd_ros.learning.derived import DerivedColumns, features_of
from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.trajectories import Transitions


class RewardForm(StrEnum):
    """How strategy i's reward R_i is put together."""

    TWO_COLUMN = "two_column"
    """R_i = R0 + alpha_i S_i: MSRD (paper, Equation 4)."""
    VANILLA = "vanilla"
    """Separate networks R_i and R0, S_i read off as R_i - R0: vanilla distillation (paper, Equation 6)."""
    TASK_ONLY = "task_only"
    """R_i = R0: AIRL with one reward for everyone."""
    STRATEGY_ONLY = "strategy_only"
    """R_i = S_i, nothing shared: AIRL for each strategy on its own."""


@dataclass(frozen=True)
class RewardValues:
    """Rewards of the same transitions, each ``[S, N]``: R_i, R0 and S_i."""

    combined: Tensor
    task: Tensor
    strategy: Tensor


class Nearness(nn.Module):
    """``-weight log(1 + d^2)``, d^2 the mean squared deviation of the inputs from what is demonstrated.

    Up to its weight the log-density of a Student's t: quadratic near the demonstrations, and far from them so
    slow that a lost episode does not outweigh all others.

    Parameters
    ----------
    centre, deviation
        Of the demonstrations, one value for each input.
    weight
        To start with; it is learned.
    """

    centre: Tensor
    deviation: Tensor

    def __init__(self, centre: Tensor, deviation: Tensor, weight: float) -> None:
        super().__init__()
        self.register_buffer("centre", centre.clone())
        self.register_buffer("deviation", deviation.clone())
        self.weight = nn.Parameter(torch.tensor(float(weight)))

    @classmethod
    def of(cls, demonstrated: Tensor, weight: float) -> Nearness | None:
        """Nearness to demonstrated inputs ``[N, W]``; None for a weight of 0."""
        if weight == 0.0:
            return None
        deviation = demonstrated.std(dim=0, correction=0)
        # A column that the demonstrations never move would be infinitely far.
        least = 1e-3 * max(1e-3, float(deviation.max()))
        return cls(demonstrated.mean(dim=0), deviation.clamp(min=least), weight)

    def forward(self, inputs: Tensor) -> Tensor:
        """Of inputs ``[..., W]``, actions behind the features left out, ``[...]``."""
        away = (inputs[..., : len(self.centre)] - self.centre) / self.deviation
        return -self.weight * torch.log1p(away.square().mean(dim=-1))


class RewardModel(nn.Module):
    """Task and strategy reward networks of three fully connected layers, looking at the next state.

    Parameters
    ----------
    form
        How R_i is composed.
    strategies
        Number of strategies, S.
    task_features, strategy_features
        What R0 and S_i see of an observation; they may differ.
    action_width
        Number of action columns appended to the features, 0 for state-only rewards.
    hidden
        Widths of the hidden layers, ``(32, 32)`` in the paper's table tennis study.
    alpha
        Weight of S_i in R_i, one value for all or one per strategy.
    generator
        Source of the initial weights.
    shaping
        Whether f_i also carries AIRL's potential ``gamma h_i(s') - h_i(s)``.
    discount
        gamma of the potential.
    reward_groups
        Which strategy-only reward each strategy has, counted from 0: strategies of the same number share
        one. Empty: each has its own.
    nearness
        What the network of R0 is added to; None: nothing.
    columns
        Names of what the features choose from: observed columns, then derived ones. Empty: nobody has said.
    derived
        How the derived ones follow from a transition; None: there are none, or nobody has said.

    Attributes
    ----------
    reward_groups
        The same as ``[S]``, or None where each has its own.
    """

    alpha: Tensor
    reward_groups: Tensor | None

    def __init__(
        self,
        form: RewardForm,
        strategies: int,
        task_features: Features,
        strategy_features: Features,
        action_width: int,
        hidden: tuple[int, ...],
        alpha: float | tuple[float, ...],
        generator: torch.Generator,
        shaping: bool = False,
        discount: float = 0.99,
        reward_groups: tuple[int, ...] = (),
        nearness: Nearness | None = None,
        columns: Sequence[str] = (),
        derived: DerivedColumns | None = None,
    ) -> None:
        super().__init__()
        self.columns, self.derived = tuple(columns), derived
        reward_groups = reward_groups or tuple(range(strategies))
        if len(reward_groups) != strategies or set(reward_groups) != set(range(max(reward_groups) + 1)):
            raise ValueError(
                f"reward_groups {reward_groups}: give {strategies} numbers, counted from 0 without gaps"
            )
        shared = len(set(reward_groups)) < strategies
        self.register_buffer(
            "reward_groups", torch.tensor(reward_groups) if shared else None, persistent=False
        )
        self.form = RewardForm(form)
        self.strategies = strategies
        self.sees_action = action_width > 0
        self.discount = discount
        self.task_features = task_features
        self.strategy_features = strategy_features
        self.nearness = nearness
        self.task_network = BatchedMLP(1, (task_features.width + action_width, *hidden, 1), generator)
        sizes = (strategy_features.width + action_width, *hidden, 1)
        self.strategy_network = BatchedMLP(len(set(reward_groups)), sizes, generator)
        self.potential_network = (
            BatchedMLP(strategies, (strategy_features.width, *hidden, 1), generator) if shaping else None
        )
        weights = torch.tensor(alpha, dtype=torch.float32).reshape(-1, 1)
        if len(weights) not in (1, strategies):
            raise UserError(f"reward.alpha: {len(weights)} values for {strategies} strategies; give one each")
        self.register_buffer("alpha", weights.expand(strategies, 1).clone())

    def forward(self, transitions: Transitions) -> RewardValues:
        """R_i, R0 and S_i of ``[S, N]`` transitions, row i judged by strategy i."""
        return self.compose(self.task_inputs(transitions), self.strategy_inputs(transitions))

    def compose(self, task_inputs: Tensor, strategy_inputs: Tensor) -> RewardValues:
        """Equation 4 from scaled inputs ``[S, N, ...]``; for the other forms see `RewardForm`."""
        if self.form is RewardForm.STRATEGY_ONLY:
            strategy = self._own(strategy_inputs)
            return RewardValues(strategy, torch.zeros_like(strategy), strategy)
        task = self.task(task_inputs)
        if self.form is RewardForm.TASK_ONLY:
            return RewardValues(task, task, torch.zeros_like(task))
        own = self._own(strategy_inputs)
        if self.form is RewardForm.VANILLA:
            return RewardValues(own, task, own - task)
        return RewardValues(task + self.alpha * own, task, own)

    def task_parameters(self) -> Iterator[nn.Parameter]:
        """All weights of R0."""
        yield from self.task_network.parameters()
        if self.nearness is not None:
            yield from self.nearness.parameters()

    def with_room(
        self, groups: tuple[int, ...], alpha: float | tuple[float, ...], generator: torch.Generator
    ) -> RewardModel:
        """R0 as it is here, with strategy networks of the same size that know nothing yet.

        Parameters
        ----------
        groups
            ``reward_groups`` of the new strategies.
        alpha
            Their weights.

        Returns
        -------
        RewardModel
            Of two columns, without shaping; it shares nothing with this one.
        """
        room = RewardModel(
            RewardForm.TWO_COLUMN,
            len(groups),
            copy.deepcopy(self.task_features),
            copy.deepcopy(self.strategy_features),
            self.task_network.sizes[0] - self.task_features.width,
            tuple(self.strategy_network.sizes[1:-1]),
            alpha,
            generator,
            discount=self.discount,
            reward_groups=groups,
            nearness=copy.deepcopy(self.nearness),
            columns=self.columns,
            derived=self.derived,
        )
        room.task_network.load_state_dict(self.task_network.state_dict())
        return room

    def on(self, observation_names: Sequence[str], derived: DerivedColumns | None = None) -> RewardModel:
        """The same rewards for other observations, such as those of another robot: columns go by their names.

        Parameters
        ----------
        observation_names
            The observed columns there.
        derived
            What follows from transitions there.

        Raises
        ------
        UserError
            If these rewards see a column that is not there; names it.
        """
        there = (*observation_names, *(() if derived is None else derived.names))
        model = copy.deepcopy(self)
        for part in ("task_features", "strategy_features"):
            features: Features = getattr(model, part)
            names = [self.columns[index] for index in features.indices.tolist()]
            missing = [name for name in names if name not in there]
            if missing:
                raise UserError(f"rewards: see {', '.join(missing)}; there are {', '.join(there)}")
            indices = tuple(there.index(name) for name in names)
            moved = Features(indices, tuple(features.offset.tolist()), tuple(features.scale.tolist()))
            setattr(model, part, moved)
        model.columns, model.derived = there, derived
        return model

    def shaping(self, transitions: Transitions) -> Tensor | float:
        """AIRL's potential-based shaping ``gamma h_i(s') - h_i(s)``, ``[S, N]``, or 0."""
        if self.potential_network is None:
            return 0.0
        if self.strategy_features.highest >= transitions.observation_width:
            raise UserError(
                "rewards: a potential is of states, and S_i sees derived columns; use one of them"
            )
        after = self.potential_network(self.strategy_features(transitions.next_observation))
        before = self.potential_network(self.strategy_features(transitions.observation))
        return (self.discount * after - before).squeeze(-1)

    def task_inputs(self, transitions: Transitions) -> Tensor:
        """Scaled features of the next state, and the action if rewards see it, for R0."""
        return self._inputs(self.task_features, transitions)

    def strategy_inputs(self, transitions: Transitions) -> Tensor:
        """The same for S_i."""
        return self._inputs(self.strategy_features, transitions)

    def _inputs(self, features: Features, transitions: Transitions) -> Tensor:
        inputs = features_of(features, transitions, self.derived)
        return torch.cat([inputs, transitions.action], dim=-1) if self.sees_action else inputs

    def _own(self, inputs: Tensor) -> Tensor:
        return self.strategy_network(inputs, self.reward_groups).squeeze(-1)

    def task(self, inputs: Tensor) -> Tensor:
        """R0 of scaled inputs ``[S, N, ...]``, ``[S, N]``."""
        strategies, count, width = inputs.shape
        values = self.task_network(inputs.reshape(1, strategies * count, width)).reshape(strategies, count)
        return values if self.nearness is None else values + self.nearness(inputs)


class RewardEnsemble(nn.ModuleList):
    """Reward models of independent runs as one: the mean of what they say, by state.

    Adversarial runs differ most where demonstrations and rollouts decide least; what they have in common
    stays in the mean, what one run made up does not.

    Parameters
    ----------
    members
        Models of one form and one number of strategies.
    """

    def __init__(self, members: Iterable[RewardModel]) -> None:
        super().__init__(members)

    @property
    def members(self) -> tuple[RewardModel, ...]:
        """The models."""
        return tuple(cast(RewardModel, member) for member in self)

    @property
    def form(self) -> RewardForm:
        """How R_i is composed."""
        return self.members[0].form

    @property
    def strategies(self) -> int:
        """Number of strategies, S."""
        return self.members[0].strategies

    @torch.no_grad()
    def task(self, states: Tensor) -> Tensor:
        """R0 of states ``[..., O]``, ``[...]``."""
        single = states.reshape(1, -1, states.shape[-1])
        values = [model.task(model.task_features(single))[0] for model in self.members]
        return torch.stack(values).mean(dim=0).reshape(states.shape[:-1])

    @torch.no_grad()
    def forward(self, transitions: Transitions) -> RewardValues:
        """R_i, R0 and S_i of ``[S, N]`` transitions, row i judged by strategy i."""
        tables = [model(transitions) for model in self.members]
        return RewardValues(
            torch.stack([values.combined for values in tables]).mean(dim=0),
            torch.stack([values.task for values in tables]).mean(dim=0),
            torch.stack([values.strategy for values in tables]).mean(dim=0),
        )


class AveragedRewards:
    """Exponential moving average of a reward model's weights, for reporting.

    Adversarial training circles around its solution; the average of the iterates does not. It starts as
    the plain mean and becomes exponential once ``1 / updates < rate``.
    """

    def __init__(self, model: RewardModel, rate: float) -> None:
        self.model = copy.deepcopy(model).requires_grad_(False)
        self.rate = rate
        self.updates = 0

    def update(self, model: RewardModel) -> None:
        """Move the average towards the weights of `model`."""
        self.updates += 1
        weight = max(self.rate, 1.0 / self.updates)
        with torch.no_grad():
            for target, source in zip(self.model.parameters(), model.parameters(), strict=True):
                target.lerp_(source, weight)
