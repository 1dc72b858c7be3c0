"""What training gives: rewards and policies by the names of their strategies, in one file without code."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from safetensors.torch import save as save_tensors
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.learning.checkpoints import read_rewards
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.policy import PREFIX, Policy, PolicySet, make_header
from msrd_ros.learning.reward_files import REWARDS_PREFIX, describe_rewards, load_rewards
from msrd_ros.learning.rewards import RewardForm, RewardModel
from msrd_ros.learning.trajectories import Transitions

if TYPE_CHECKING:
    import gymnasium


@dataclass(frozen=True)
class Learned:
    """Rewards and policies of every strategy.

    Attributes
    ----------
    policies
        All policies, with the columns that they see.
    rewards
        R0 and S_i; None of a method that learns none.
    details
        How they were learned: ``method``, ``seed``, ``config``, ``curve`` (JSON).
    """

    policies: PolicySet
    rewards: RewardModel | None
    details: dict[str, Any]

    @property
    def layout(self) -> Layout:
        """Names of columns and strategies."""
        return self.policies.layout

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the strategies."""
        return self.layout.labels

    def task_reward(
        self,
        observations: ArrayLike,
        actions: ArrayLike | None = None,
        before: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """R0, what everyone wants.

        Parameters
        ----------
        observations
            States ``[..., O]``: of a transition the one that it leads to.
        actions
            ``[..., A]``, for rewards that were learned with ``sees_action`` alone.
        before
            The states ``[..., O]`` that the transitions start from, for rewards of derived columns alone.

        Returns
        -------
        NDArray
            ``[...]``, of no unit; only differences mean anything.

        Raises
        ------
        UserError
            If the method has no task reward, or the columns do not go with the layout.
        """
        model = self._model()
        if model.form is RewardForm.STRATEGY_ONLY:
            raise UserError(f"{self._method}: learns no task reward; use strategy_reward, or train with msrd")
        if before is None and model.task_features.highest < len(self.layout.observation_names):
            before = observations  # S_i may see derived columns, and is not asked
        return self._evaluate(observations, actions, before, 0)[0]

    def strategy_reward(
        self,
        name: str,
        observations: ArrayLike,
        actions: ArrayLike | None = None,
        before: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """S_i, what strategy `name` wants beside the task; arguments and errors as of `task_reward`."""
        row = self._row(name)
        model = self._model()
        if model.form is RewardForm.TASK_ONLY:
            raise UserError(
                f"{self._method}: learns no strategy rewards; use task_reward, or train with msrd"
            )
        return self._evaluate(observations, actions, before, row)[1]

    def reward(
        self,
        name: str,
        observations: ArrayLike,
        alpha: float | None = None,
        actions: ArrayLike | None = None,
        before: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """R_i = R0 + alpha S_i, what strategy `name` wants altogether; `alpha` None: as it was trained.

        Whatever of the two a method does not have counts 0. Arguments and errors as of `task_reward`.
        """
        row = self._row(name)
        model = self._model()
        task, strategy = self._evaluate(observations, actions, before, row)
        weight = float(model.alpha[row if model.strategies > 1 else 0]) if alpha is None else alpha
        return task + weight * strategy

    def policy(self, name: str) -> Policy:
        """The policy of strategy `name`; its ``act(observation)`` is the action in the environment's units.

        Raises
        ------
        UserError
            If there is no such strategy.
        """
        self._row(name)
        return self.policies.policy(name)

    def wrap(
        self, environment: gymnasium.Env[Any, Any], name: str, alpha: float | None = None
    ) -> gymnasium.Env[Any, Any]:
        """`environment` paying R0 + alpha S_i instead of its own reward; see `LearnedReward`."""
        from msrd_ros.learning.reward_wrapper import LearnedReward

        return LearnedReward(environment, self, name, alpha)

    def save(self, path: str | Path) -> None:
        """Write everything to one safetensors file, whole or not at all.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        tensors = {PREFIX + key: torch.as_tensor(value) for key, value in self.policies.tensors.items()}
        details = dict(self.details)
        if self.rewards is not None:
            details["rewards"] = describe_rewards(self.rewards)
            state = self.rewards.state_dict()
            tensors |= {REWARDS_PREFIX + key: value.contiguous() for key, value in state.items()}
        header = make_header(self.layout, self.policies.digest, details)
        write_atomically(Path(path), save_tensors(tensors, metadata=header))

    @classmethod
    def load(cls, path: str | Path) -> Learned:
        """Inverse of `save`; a checkpoint of training will do as well.

        Its rewards are those averaged over iterations; None where none has been trained yet.

        Raises
        ------
        UserError
            If the file cannot be read, is damaged or is something else.
        """
        policies = PolicySet.load(Path(path))
        details = dict(policies.details)
        described = details.pop("rewards", None)
        if details.pop("trainer", None) is not None:
            rewards = read_rewards(Path(path))
        else:
            # Files of before there were derived columns say nothing of columns.
            columns = {"columns": policies.layout.observation_names}
            rewards = None if described is None else load_rewards(Path(path), columns | described)
        return cls(policies, rewards, details)

    @property
    def _method(self) -> str:
        return f"method {self.details.get('method', 'unknown')!r}"

    def _model(self) -> RewardModel:
        if self.rewards is None:
            raise UserError(f"{self._method}: learns policies and no reward; train with method='msrd'")
        return self.rewards

    def _row(self, name: str) -> int:
        if name not in self.labels:
            raise UserError(f"no strategy {name!r}; there are {', '.join(self.labels)}")
        return self.labels.index(name)

    @torch.no_grad()
    def _evaluate(
        self, observations: ArrayLike, actions: ArrayLike | None, before: ArrayLike | None, row: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """R0 and S_i of strategy `row` as the discriminator sums them, 0 where the form has none."""
        model = self._model()
        states = self._columns("observation", observations, self.layout.observation_names)
        width = len(self.layout.action_names)
        acted: Tensor = torch.zeros(*states.shape[:-1], width)
        if model.sees_action:
            if actions is None:
                raise UserError("these rewards see actions as well; pass actions=")
            acted = self._columns("action", actions, self.layout.action_names)
            if "action_scale" in self.details:
                centre, half = (torch.tensor(self.details["action_scale"][key]) for key in ("centre", "half"))
                acted = (acted - centre) / half
        start = states
        if before is not None:
            start = self._columns("observation", before, self.layout.observation_names)
        elif max(model.task_features.highest, model.strategy_features.highest) >= states.shape[-1]:
            raise UserError("these rewards see what follows from two states; pass before=")
        packed = torch.cat([start, acted, states, torch.zeros(*states.shape[:-1], 2)], dim=-1)
        rows = packed.reshape(1, -1, packed.shape[-1]).expand(model.strategies, -1, -1)
        values = model(Transitions(rows, states.shape[-1], width))
        chosen = row if model.strategies > 1 else 0
        parts = (values.task[chosen], values.strategy[chosen])
        task, strategy = (part.reshape(states.shape[:-1]).double().numpy() for part in parts)
        return task, strategy

    @staticmethod
    def _columns(kind: str, values: ArrayLike, names: tuple[str, ...]) -> Tensor:
        array = np.asarray(values, dtype=np.float32)
        if array.ndim == 0 or array.shape[-1] != len(names):
            raise UserError(
                f"{kind}s of shape {array.shape}: the last axis has to be the {len(names)} columns "
                f"{', '.join(names)}"
            )
        return torch.as_tensor(array)
