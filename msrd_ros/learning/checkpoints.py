"""Checkpoints of training: written atomically, resumed exactly, never unpickled.

A checkpoint is a policy file (see `policy`) with the trainer's own tensors beside the policies'.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.core.formats import renamed
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.method import Learner
from msrd_ros.learning.networks import Features
from msrd_ros.learning.policies import GaussianPolicies, Policies
from msrd_ros.learning.policy import PREFIX, PolicySet, make_header, read_header
from msrd_ros.learning.reward_files import restore_rewards
from msrd_ros.learning.rewards import RewardModel

TRAINER_PREFIX = "trainer/"

_RENAMED = {
    "sweeps": "iterations",
    "sweeps_done": "iterations_done",
    "demonstrations_per_sweep": "demonstrations_per_iteration",
    "owners": "reward_groups",
    "uses_density": "uses_log_prob",
    "centre_density": "centre_log_prob",
    "density_bounds": "log_prob_bounds",
    "average": "ema_rate",
    "disturbances": "noise_levels",
    "corrections": "recovery_labels",
}
"""Names of 0.1.0, and what they are called now."""
_ADDED = {
    "reward": {"nearness": 0.0},
    "replay": {"displaced_share": 0.0},
    "policy": {"reference_price": 0.0},
}
"""Settings that 0.1.0 did not have, and what it did."""


def export_policies(policies: Policies, layout: Layout, details: dict[str, Any] | None = None) -> PolicySet:
    """The policies as the executor plays them.

    Raises
    ------
    UserError
        If they are not Gaussian.
    """
    if not isinstance(policies, GaussianPolicies):
        raise UserError("only Gaussian policies can be kept; use MSRD itself for others")
    layers = enumerate(zip(policies.network.weights, policies.network.biases, strict=True))
    tensors: dict[str, np.ndarray] = {}
    for layer, (weight, bias) in layers:
        tensors[f"weight/{layer}"] = weight.detach().numpy().copy()
        tensors[f"bias/{layer}"] = bias.detach().numpy().copy()
    tensors["log_std"] = policies.log_std.detach().numpy().copy()
    for name in ("indices", "offset", "scale"):
        tensors[name] = getattr(policies.features, name).numpy().copy()
    return PolicySet(layout, tensors, details or {})


def import_policies(policies: PolicySet) -> GaussianPolicies:
    """Inverse of `export_policies`: policies that can be learned further, all of a set side by side."""
    tensors = policies.tensors
    features = Features(*(tuple(tensors[name].tolist()) for name in ("indices", "offset", "scale")))
    weights = [
        tensors[f"weight/{layer}"] for layer in range(sum(name.startswith("weight/") for name in tensors))
    ]
    hidden, actions = tuple(weight.shape[2] for weight in weights[:-1]), weights[-1].shape[2]
    bounds = float(tensors["log_std"].min()), float(tensors["log_std"].max())
    found = GaussianPolicies(len(weights[0]), features, actions, hidden, 0.0, *bounds, torch.Generator())
    with torch.no_grad():
        found.log_std.copy_(torch.as_tensor(tensors["log_std"]))
        for layer, weight in enumerate(weights):
            found.network.weights[layer].copy_(torch.as_tensor(weight))
            found.network.biases[layer].copy_(torch.as_tensor(tensors[f"bias/{layer}"]))
    return found


def save_checkpoint(path: Path, trainer: Learner, metrics: dict[str, float] | None = None) -> None:
    """Write `trainer` to `path`, whole or not at all.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    tensors: dict[str, torch.Tensor] = {}
    tree = _detach_tensors(trainer.state_dict(), tensors)
    details = {
        "config": trainer.config.to_dict(),
        "metrics": metrics or {},
        "versions": {"torch": version("torch"), "numpy": version("numpy")},
        "trainer": tree,
    }
    policies = export_policies(trainer.policies, trainer.layout)
    everything = {TRAINER_PREFIX + name: value for name, value in tensors.items()}
    everything |= {PREFIX + name: torch.as_tensor(value) for name, value in policies.tensors.items()}
    data = save_tensors(everything, metadata=make_header(trainer.layout, policies.digest, details))
    write_atomically(Path(path), data)


def load_checkpoint(path: Path, trainer: Learner) -> None:
    """Take up training where `path` left it.

    Parameters
    ----------
    trainer
        Built with the same configuration and the same demonstrations.

    Raises
    ------
    UserError
        If the file is damaged, or made for another layout or configuration.
    """
    layout, config, tree, own = _read(Path(path))
    layout.require(trainer.layout, str(path))
    if layout.labels != trainer.layout.labels:
        raise UserError(
            f"{path}: trained on strategies {', '.join(layout.labels)}, not on "
            f"{', '.join(trainer.layout.labels)}; start anew"
        )
    different = _differences(config, json.loads(json.dumps(trainer.config.to_dict())))
    if different:
        raise UserError(
            f"{path}: trained with other settings: {'; '.join(different)}; start anew or use those"
        )
    try:
        trainer.load_state_dict(renamed(_attach_tensors(tree, own), _RENAMED))
    except (KeyError, RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise UserError(f"{path}: damaged checkpoint ({reason}); start anew or use another") from None


def read_rewards(path: Path) -> RewardModel | None:
    """R0 and S_i of a checkpoint, averaged over iterations; None where no reward has been trained yet.

    Raises
    ------
    UserError
        If the file is damaged, or no checkpoint of training.
    """
    layout, config, tree, own = _read(path)
    try:
        averaged = _attach_tensors(tree, own)["averaged"]
        if not int(averaged["updates"]):
            return None
        reward, weights = config["reward"], averaged["weights"]
        described = {
            **reward,
            "strategies": len(weights["alpha"]),
            "action_width": len(layout.action_names) if reward["sees_action"] else 0,
            "discount": config["discount"],
            # Files of before there were derived columns say nothing of them.
            "columns": averaged.get("columns", layout.observation_names),
        }
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{path}: no rewards in this checkpoint ({error}); train with msrd") from None
    return restore_rewards(described, weights, path)


def _read(path: Path) -> tuple[Layout, dict[str, Any], dict[str, Any], dict[str, torch.Tensor]]:
    """Layout, configuration under present names, nested state and tensors of a checkpoint."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot read the checkpoint: {error.strerror}") from None
    header = read_header(data, str(path))
    try:
        layout, details = Layout.from_dict(header["layout"]), header["details"]
        tree, config = details["trainer"], renamed(details["config"], _RENAMED)
        config |= {part: added | config[part] for part, added in _ADDED.items()}
        everything = load_tensors(data)
    except (KeyError, TypeError, SafetensorError) as error:
        raise UserError(f"{path}: not a training checkpoint ({error}); start anew or use another") from None
    start = len(TRAINER_PREFIX)
    own = {name[start:]: value for name, value in everything.items() if name.startswith(TRAINER_PREFIX)}
    return layout, config, tree, own


def _detach_tensors(node: Any, tensors: dict[str, torch.Tensor]) -> Any:
    """Move tensors out of a nested state into `tensors`, leaving JSON."""
    if isinstance(node, torch.Tensor):
        name = str(len(tensors))
        tensors[name] = node.detach().contiguous().clone()
        return {"tensor": name}
    if isinstance(node, dict):
        return {"items": [[key, _detach_tensors(value, tensors)] for key, value in node.items()]}
    if isinstance(node, list | tuple):
        return {"list": [_detach_tensors(value, tensors) for value in node]}
    return {"value": node}


def _attach_tensors(node: dict[str, Any], tensors: dict[str, torch.Tensor]) -> Any:
    """Inverse of `_detach_tensors` (tuples come back as lists)."""
    if "tensor" in node:
        return tensors[node["tensor"]]
    if "items" in node:
        return {key: _attach_tensors(value, tensors) for key, value in node["items"]}
    if "list" in node:
        return [_attach_tensors(value, tensors) for value in node["list"]]
    return node["value"]


def _differences(found: Any, wanted: Any, name: str = "") -> list[str]:
    if isinstance(found, dict) and isinstance(wanted, dict):
        parts = []
        for key in sorted(set(found) | set(wanted)):
            parts += _differences(found.get(key), wanted.get(key), f"{name}.{key}" if name else key)
        return parts
    return [] if found == wanted else [f"{name} {found} instead of {wanted}"]
