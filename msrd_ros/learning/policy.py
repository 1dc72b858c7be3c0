"""Learned policies as the executor plays them: NumPy only, one strategy at a time, tens of microseconds.

The file format is safetensors with one JSON text in its header (key ``msrd_ros``): layout, digest,
configuration, metrics, versions. Nothing is ever unpickled. A trainer's checkpoint holds the same tensors
under the same names beside its own, so that every checkpoint is also a policy file.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import require_format
from msrd_ros.learning.layout import Layout

FORMAT_VERSION = 1
HEADER_KEY = "msrd_ros"
PREFIX = "policies/"


@dataclass(frozen=True)
class Policy:
    """One strategy's policy: ``mean(s) = MLP((s[indices] - offset) / scale)``, Gaussian around it.

    Attributes
    ----------
    label
        Name of the strategy.
    weights, biases
        Layer by layer ``[in, out]`` and ``[out]``; tanh between layers.
    log_std
        ``[A]``, natural logarithm of the standard deviation it explored with.
    indices, offset, scale
        Columns of the observation it sees, and their scaling.
    """

    label: str
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    log_std: NDArray[np.float32]
    indices: NDArray[np.int64]
    offset: NDArray[np.float32]
    scale: NDArray[np.float32]

    def act(
        self, observation: NDArray[np.floating], noise: NDArray[np.floating] | None = None
    ) -> NDArray[np.floating]:
        """Action ``[..., A]`` for ``observation [..., O]``, not clipped; the mean unless `noise` is given."""
        hidden = (np.asarray(observation, dtype=np.float32)[..., self.indices] - self.offset) / self.scale
        last = len(self.weights) - 1
        for layer in range(last):
            hidden = np.tanh(hidden @ self.weights[layer] + self.biases[layer])
        action = hidden @ self.weights[last] + self.biases[last]
        return action if noise is None else action + np.exp(self.log_std) * noise


@dataclass(frozen=True)
class PolicySet:
    """Policies of several strategies, with what is needed to decide whether they may be played.

    Attributes
    ----------
    layout
        Columns, labels and control period they were trained for.
    tensors
        Stacked weights under the names of the file format.
    details
        Anything else worth keeping: configuration, metrics, versions (JSON).
    """

    layout: Layout
    tensors: dict[str, NDArray[Any]]
    details: dict[str, Any]

    def policy(self, label: str) -> Policy:
        """The policy of strategy `label`.

        Raises
        ------
        UserError
            If there is none.
        """
        if label not in self.layout.labels:
            known = ", ".join(self.layout.labels)
            raise UserError(f"no policy for strategy {label!r}; this checkpoint has {known}")
        index = self.layout.labels.index(label)
        layers = range(sum(name.startswith("weight/") for name in self.tensors))
        return Policy(
            label,
            tuple(self.tensors[f"weight/{layer}"][index] for layer in layers),
            tuple(self.tensors[f"bias/{layer}"][index, 0] for layer in layers),
            self.tensors["log_std"][index, 0],
            self.tensors["indices"],
            self.tensors["offset"],
            self.tensors["scale"],
        )

    @property
    def stacked(self) -> list[str]:
        """Names of the tensors with a row for each strategy; the others are shared."""
        return [name for name in self.tensors if name.startswith(("weight/", "bias/"))] + ["log_std"]

    def with_policy(self, policy: Policy) -> PolicySet:
        """One strategy more, under the policy's label.

        Raises
        ------
        UserError
            If there is one of that name.
        ValueError
            If its network is not like the others'.
        """
        if policy.label in self.layout.labels:
            raise UserError(f"there is a policy for strategy {policy.label!r} already; choose another name")
        new = {"log_std": policy.log_std[None, None]}
        for layer, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
            new |= {f"weight/{layer}": weight[None], f"bias/{layer}": bias[None, None]}
        shared = {name: value for name, value in self.tensors.items() if name not in new}
        if set(shared) != {"indices", "offset", "scale"}:
            raise ValueError("the policy has other layers than those of the set")
        joined = {name: np.concatenate([self.tensors[name], value]) for name, value in new.items()}
        layout = replace(self.layout, labels=(*self.layout.labels, policy.label))
        return replace(self, layout=layout, tensors=shared | joined)

    def without(self, label: str) -> PolicySet:
        """One strategy less."""
        row = self.layout.labels.index(label)
        fewer = {name: np.delete(self.tensors[name], row, axis=0) for name in self.stacked}
        labels = tuple(name for name in self.layout.labels if name != label)
        return replace(self, layout=replace(self.layout, labels=labels), tensors=self.tensors | fewer)

    @property
    def digest(self) -> str:
        """SHA-256 over names, shapes and values of the tensors."""
        return tensor_digest(self.tensors)

    def to_bytes(self) -> bytes:
        """A complete policy file."""
        header = make_header(self.layout, self.digest, self.details)
        tensors = {PREFIX + name: np.ascontiguousarray(value) for name, value in self.tensors.items()}
        return save_tensors(tensors, metadata=header)

    @classmethod
    def from_bytes(cls, data: bytes, where: str) -> PolicySet:
        """Read a policy file or a trainer's checkpoint.

        Parameters
        ----------
        where
            File or topic, to blame in errors.

        Raises
        ------
        UserError
            If `data` is no such file, is damaged, or holds numbers that are not finite.
        """
        header = read_header(data, where)
        try:
            everything = load_tensors(data)
            layout = Layout.from_dict(header["layout"])
            details = header.get("details", {})
            if not isinstance(details, dict):
                raise TypeError("its details are no mapping")
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            raise UserError(f"{where}: damaged checkpoint ({error}); use another one") from None
        found = {name[len(PREFIX) :]: value for name, value in everything.items() if name.startswith(PREFIX)}
        policies = cls(layout, found, details)
        if policies.digest != header.get("digest"):
            raise UserError(f"{where}: the policies do not match their digest; the file was altered")
        _check_shapes(policies, where)
        return policies

    @classmethod
    def load(cls, path: Path) -> PolicySet:
        """Read ``path``; see `from_bytes`."""
        try:
            return cls.from_bytes(Path(path).read_bytes(), str(path))
        except OSError as error:
            raise UserError(f"{path}: cannot read the checkpoint: {error.strerror}") from None


def _check_shapes(policies: PolicySet, where: str) -> None:
    """Refuse a policy file whose tensors cannot be played."""
    problem = _missing(policies) or _misshapen(policies) or _unusable(policies)
    if problem:
        raise UserError(f"{where}: damaged checkpoint ({problem}); use another one")


def _missing(policies: PolicySet) -> str:
    layers = max(_layers(policies), 1)
    needed = {"log_std", "indices", "offset", "scale"}
    needed |= {f"{kind}/{layer}" for kind in ("weight", "bias") for layer in range(layers)}
    absent = needed - set(policies.tensors)
    return f"tensor {min(absent)} is missing" if absent else ""


def _misshapen(policies: PolicySet) -> str:
    tensors, layout = policies.tensors, policies.layout
    count, seen = len(layout.labels), tensors["indices"].size
    weights = [tensors[f"weight/{layer}"] for layer in range(_layers(policies))]
    if any(weight.ndim != 3 for weight in weights):
        return "a weight is no stack of matrices"
    if weights[0].shape[0] != count:
        return f"{weights[0].shape[0]} policies for {count} labels"
    if weights[0].shape[1] != seen:
        return "the first layer does not go with the observation"
    if weights[-1].shape[2] != len(layout.action_names):
        return "the last layer does not give one output per action"
    wanted: dict[str, tuple[int, ...]] = {
        "log_std": (count, 1, len(layout.action_names)),
        "indices": (seen,),
        "offset": (seen,),
        "scale": (seen,),
    }
    width = seen
    for layer, weight in enumerate(weights):
        wanted[f"weight/{layer}"] = (count, width, weight.shape[2])
        width = weight.shape[2]
        wanted[f"bias/{layer}"] = (count, 1, width)
    for name, shape in wanted.items():
        if tensors[name].shape != shape:
            return f"tensor {name} has the shape {tensors[name].shape}, not {shape}"
    return ""


def _unusable(policies: PolicySet) -> str:
    tensors = policies.tensors
    if not all(np.isfinite(value).all() for value in tensors.values()):
        return "a weight is not a finite number"
    indices, columns = tensors["indices"], len(policies.layout.observation_names)
    if indices.dtype.kind != "i" or (indices.size and not 0 <= indices.min() <= indices.max() < columns):
        return "the first layer does not go with the observation"
    if not tensors["scale"].all():
        return "a column is scaled by zero"
    return ""


def _layers(policies: PolicySet) -> int:
    return sum(name.startswith("weight/") for name in policies.tensors)


def tensor_digest(tensors: dict[str, NDArray[Any]]) -> str:
    """SHA-256 over names, shapes and values, in the order of the names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        value = np.ascontiguousarray(tensors[name])
        digest.update(f"{name} {value.dtype} {value.shape}".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()


def make_header(layout: Layout, digest: str, details: dict[str, Any]) -> dict[str, str]:
    """The metadata of a policy file or checkpoint."""
    content = {"format": FORMAT_VERSION, "layout": layout.to_dict(), "digest": digest, "details": details}
    return {HEADER_KEY: json.dumps(content)}


def read_header(data: bytes, where: str) -> dict[str, Any]:
    """The JSON in a safetensors header.

    Raises
    ------
    UserError
        If `data` is no checkpoint of this package, or of a newer format.
    """
    try:
        length = int.from_bytes(data[:8], "little")
        if not 0 < length <= len(data) - 8:
            raise ValueError
        header = json.loads(data[8 : 8 + length])
        content: dict[str, Any] = json.loads(header["__metadata__"][HEADER_KEY])
        version = content["format"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise UserError(f"{where}: not a checkpoint of msrd_ros; give one that the trainer wrote") from None
    require_format(version, FORMAT_VERSION, where)
    return content
