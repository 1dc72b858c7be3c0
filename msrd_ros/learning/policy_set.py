"""The policies of all strategies as one file of plain arrays, ready to play.

What the executor loads and what travels on the topic ``policy``: safetensors bytes whose metadata hold the
labels and the layout of observation and action. NumPy is all it takes to play them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from msrd_ros.facts.episode import ACTING_STEPS, ACTION_NAMES, CONTROL_PERIOD_S, OBSERVATION_NAMES
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import StrategyLabel
from msrd_ros.facts.sawyer import JOINT_COUNT
from msrd_ros.learning.layout import Layout

PolicyFunction = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Maps an observation (O,) to an action (A,)."""

FORMAT = "msrd_ros policy set 1"


def stroke_layout(labels: Sequence[StrategyLabel]) -> Layout:
    """The layout of this package's strokes: what every policy that the executor plays must have."""
    return Layout(OBSERVATION_NAMES, ACTION_NAMES, tuple(map(str, labels)), CONTROL_PERIOD_S)


class StrokeDraws(NamedTuple):
    """Standard normal draws of one stroke: start posture (7,) and exploration (T_act, 7)."""

    ready: NDArray[np.float64]
    action: NDArray[np.float64]

    @classmethod
    def of(cls, seed: int, index: int) -> StrokeDraws:
        """The draws of stroke number `index`: the same whoever plays it, in process or over topics."""
        rng = np.random.default_rng((seed, index))
        return cls(rng.standard_normal(JOINT_COUNT), rng.standard_normal((ACTING_STEPS, JOINT_COUNT)))


@dataclass(frozen=True)
class PolicySet:
    """Gaussian policies of several strategies.

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
    log_std
        Spread of the actions when exploring, shape (S, A).
    layout
        Names of what goes in and comes out.
    exploration_seed
        Of the draws with which the actions are to be varied; None plays the means.
    """

    labels: tuple[StrategyLabel, ...]
    ready_poses: NDArray[np.float64]
    landing_points: NDArray[np.float64]
    input_offset: NDArray[np.float64]
    input_scale: NDArray[np.float64]
    weights: tuple[NDArray[np.float64], ...]
    biases: tuple[NDArray[np.float64], ...]
    log_std: NDArray[np.float64]
    layout: Layout
    exploration_seed: int | None = None

    def policy(self, label: StrategyLabel) -> PolicyFunction:
        """The mean of one strategy's policy: observation (O,) to action (A,).

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

    def explorer(self, label: StrategyLabel, draws: StrokeDraws) -> PolicyFunction:
        """One stroke of a strategy's policy with its actions varied by `draws`."""
        mean = self.policy(label)
        noise = iter(draws.action * np.exp(self.log_std[self.index(label)]))

        def act(observation: NDArray[np.float64]) -> NDArray[np.float64]:
            return mean(observation) + next(noise)

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
            "log_std": self.log_std,
        }
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays[f"weight_{layer}"], arrays[f"bias_{layer}"] = weight, bias
        # One entry only: safetensors does not keep the order of several.
        facts = {
            "format": FORMAT,
            "layout": self.layout.to_dict(),
            "exploration_seed": self.exploration_seed,
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
            layout = Layout.from_dict(facts["layout"])
            layers = sum(name.startswith("weight_") for name in arrays)
            found = cls(
                tuple(StrategyLabel.parse(label, where) for label in layout.labels),
                arrays["ready_poses"],
                arrays["landing_points"],
                arrays["input_offset"],
                arrays["input_scale"],
                tuple(arrays[f"weight_{layer}"] for layer in range(layers)),
                tuple(arrays[f"bias_{layer}"] for layer in range(layers)),
                arrays["log_std"],
                layout,
                facts["exploration_seed"],
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
