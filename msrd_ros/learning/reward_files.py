"""Reward models in files: what their tensors do not say themselves, and models made of both again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.learning.networks import Features
from msrd_ros.learning.rewards import Nearness, RewardForm, RewardModel

REWARDS_PREFIX = "rewards/"
_FEATURES = ("indices", "offset", "scale")


def describe_rewards(model: RewardModel) -> dict[str, Any]:
    """What the tensors of a reward model do not say themselves, as data for JSON."""
    return {
        "form": model.form.value,
        "strategies": model.strategies,
        "hidden": list(model.task_network.sizes[1:-1]),
        "action_width": model.task_network.sizes[0] - model.task_features.width,
        "nearness": model.nearness is not None,
        "shaping": model.potential_network is not None,
        "discount": model.discount,
        "columns": list(model.columns),
        "reward_groups": [] if model.reward_groups is None else model.reward_groups.tolist(),
    }


def load_rewards(path: Path, described: Mapping[str, Any]) -> RewardModel:
    """The reward model of a file that `Learned.save` wrote.

    Raises
    ------
    UserError
        If the rewards are damaged; names the file.
    """
    try:
        everything = load_tensors(path.read_bytes())
    except SafetensorError as error:
        raise _damaged(path, error) from None
    start = len(REWARDS_PREFIX)
    own = {name[start:]: value for name, value in everything.items() if name.startswith(REWARDS_PREFIX)}
    return restore_rewards(described, own, path)


def restore_rewards(described: Mapping[str, Any], own: Mapping[str, Tensor], path: Path) -> RewardModel:
    """A reward model from what `describe_rewards` said and its `state_dict`.

    Parameters
    ----------
    path
        The file that both are from, to blame.

    Raises
    ------
    UserError
        If they do not go together, or a weight is not a finite number.
    """
    try:
        task, strategy = (
            Features(*(tuple(own[f"{part}_features.{name}"].tolist()) for name in _FEATURES))
            for part in ("task", "strategy")
        )
        model = RewardModel(
            RewardForm(described["form"]),
            int(described["strategies"]),
            task,
            strategy,
            int(described["action_width"]),
            tuple(int(width) for width in described["hidden"]),
            1.0,
            torch.Generator(),
            bool(described["shaping"]),
            float(described["discount"]),
            tuple(int(group) for group in described["reward_groups"]),
            # Files of before there was one say nothing of it.
            Nearness(own["nearness.centre"], own["nearness.deviation"], 0.0)
            if described.get("nearness")
            else None,
            tuple(described.get("columns", ())),
        )
        model.load_state_dict(own)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise _damaged(path, error) from None
    if not all(bool(torch.isfinite(value).all()) for value in own.values()):
        raise UserError(f"{path}: damaged rewards (a weight is not a finite number); use another file")
    return model.requires_grad_(False)


def _damaged(path: Path, error: Exception) -> UserError:
    reason = str(error).splitlines()[0]
    return UserError(f"{path}: damaged rewards ({reason}); train anew or use another file")
