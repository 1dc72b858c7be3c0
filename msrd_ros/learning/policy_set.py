"""The policies of all strategies as one file of plain arrays, ready to play.

What the executor loads and what travels on the topic ``policy``: safetensors bytes whose metadata hold the
labels and the layout of observation and action. NumPy is all it takes to play them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from msrd_ros.facts.episode import ACTION_NAMES, CONTROL_PERIOD_S, OBSERVATION_NAMES
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import StrategyLabel

FORMAT = "msrd_ros policy set 1"


@dataclass(frozen=True)
class Layout:
    """What goes into a policy and what comes out, and how often."""

    observation_names: tuple[str, ...] = OBSERVATION_NAMES
    action_names: tuple[str, ...] = ACTION_NAMES
    control_period_s: float = CONTROL_PERIOD_S

    def check(self, wanted: Layout, where: str) -> None:
        """Refuse another layout.

        Raises
        ------
        UserError
            Says what differs.
        """
        for field in ("observation_names", "action_names", "control_period_s"):
            mine, theirs = getattr(self, field), getattr(wanted, field)
            if mine != theirs:
                raise UserError(
                    f"{where}: {field.replace('_', ' ')} do not fit: it has {_short(mine, theirs)}, "
                    f"wanted is {_short(theirs, mine)}; train a policy with this layout"
                )


def _short(values: Any, other: Any) -> str:
    """Only what differs, if these are lists of names."""
    if not isinstance(values, tuple):
        return str(values)
    different = [name for name in values if name not in other]
    return f"{len(values)} names" + (f" with {', '.join(different)}" if different else " in another order")


@dataclass(frozen=True)
class PolicySet:
    """Deterministic policies (the means) of several strategies.

    Attributes
    ----------
    labels
        The S strategies.
    ready_poses
        Where each strategy starts from, shape (S, 7), rad: the demonstrations' mean.
    landing_points
        Where the demonstrations' returned balls landed on average, shape (S, 2), m; NaN where unknown.
    input_offset, input_scale
        Shape (O,): the networks see ``(observation - offset) * scale``.
    weights, biases
        Layers of the networks: shapes (S, in, out) and (S, out); tanh between them.
    layout
        Names of what goes in and comes out.
    """

    labels: tuple[StrategyLabel, ...]
    ready_poses: NDArray[np.float64]
    landing_points: NDArray[np.float64]
    input_offset: NDArray[np.float64]
    input_scale: NDArray[np.float64]
    weights: tuple[NDArray[np.float64], ...]
    biases: tuple[NDArray[np.float64], ...]
    layout: Layout = Layout()

    def policy(self, label: StrategyLabel) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """The policy of one strategy: observation (O,) to action (A,).

        Raises
        ------
        UserError
            If the set has no such strategy.
        """
        index = self.index(label)
        layers = [
            (np.ascontiguousarray(w[index]), b[index]) for w, b in zip(self.weights, self.biases, strict=True)
        ]
        offset, scale = self.input_offset, self.input_scale

        def act(observation: NDArray[np.float64]) -> NDArray[np.float64]:
            value = (observation - offset) * scale
            for weight, bias in layers[:-1]:
                value = np.tanh(value @ weight + bias)
            weight, bias = layers[-1]
            return np.asarray(value @ weight + bias)

        return act

    def index(self, label: StrategyLabel) -> int:
        """Row of a strategy in all arrays."""
        if label not in self.labels:
            known = ", ".join(map(str, self.labels))
            raise UserError(f"no policy for strategy {label}; the checkpoint has {known}")
        return self.labels.index(label)

    def to_bytes(self) -> bytes:
        """Safetensors bytes, the same for the same policies."""
        arrays = {
            "ready_poses": self.ready_poses,
            "landing_points": self.landing_points,
            "input_offset": self.input_offset,
            "input_scale": self.input_scale,
        }
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays[f"weight_{layer}"], arrays[f"bias_{layer}"] = weight, bias
        # One entry only: safetensors does not keep the order of several.
        facts = {
            "format": FORMAT,
            "labels": [str(label) for label in self.labels],
            "observation_names": self.layout.observation_names,
            "action_names": self.layout.action_names,
            "control_period_s": self.layout.control_period_s,
        }
        contiguous = {name: np.ascontiguousarray(array, dtype=np.float64) for name, array in arrays.items()}
        return save_arrays(contiguous, {"policy_set": json.dumps(facts)})

    @classmethod
    def from_bytes(cls, data: bytes, where: str) -> PolicySet:
        """Read a policy set; `where` is named in errors.

        Raises
        ------
        UserError
            If the bytes are no policy set, or a value in it is not finite.
        """
        try:
            arrays = load_arrays(data)
            header_size = int.from_bytes(data[:8], "little")
            facts = json.loads(json.loads(data[8 : 8 + header_size])["__metadata__"]["policy_set"])
            layers = sum(name.startswith("weight_") for name in arrays)
            found = cls(
                tuple(StrategyLabel.parse(label, where) for label in facts["labels"]),
                arrays["ready_poses"],
                arrays["landing_points"],
                arrays["input_offset"],
                arrays["input_scale"],
                tuple(arrays[f"weight_{layer}"] for layer in range(layers)),
                tuple(arrays[f"bias_{layer}"] for layer in range(layers)),
                Layout(
                    tuple(facts["observation_names"]), tuple(facts["action_names"]), facts["control_period_s"]
                ),
            )
        except (SafetensorError, KeyError, ValueError, TypeError) as error:
            raise UserError(
                f"{where}: not a policy set of msrd_ros ({error}); give one the trainer wrote"
            ) from None
        for name, array in arrays.items():
            if name != "landing_points" and not np.isfinite(array).all():
                raise UserError(f"{where}: {name} holds values that are not finite; train again")
        return found

    @classmethod
    def load(cls, path: Path) -> PolicySet:
        """Read a policy set from a file.

        Raises
        ------
        UserError
            If there is no such file or it is no policy set.
        """
        if not path.is_file():
            raise UserError(f"{path}: no such checkpoint; train one with the trainer, or mend the path")
        return cls.from_bytes(path.read_bytes(), str(path))


def digest(data: bytes) -> str:
    """First 16 hex digits of the SHA-256 of `data`: tells one policy set from another."""
    return hashlib.sha256(data).hexdigest()[:16]
