"""Learned policies as the executor plays them: NumPy only, one strategy at a time, tens of microseconds.

The file format is safetensors with one JSON text in its header (key ``msrd_ros``): layout, digest,
configuration, metrics, versions. Nothing is ever unpickled. A trainer's checkpoint holds the same tensors
under the same names beside its own, so that every checkpoint is also a policy file.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from msrd_ros.core.errors import UserError
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
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            raise UserError(f"{where}: damaged checkpoint ({error}); use another one") from None
        found = {name[len(PREFIX) :]: value for name, value in everything.items() if name.startswith(PREFIX)}
        policies = cls(layout, found, header.get("details", {}))
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
    tensors, layout = policies.tensors, policies.layout
    problem = ""
    layers = sum(name.startswith("weight/") for name in tensors)
    needed = {"log_std", "indices", "offset", "scale"}
    needed |= {f"{kind}/{layer}" for kind in ("weight", "bias") for layer in range(max(layers, 1))}
    if needed - set(tensors):
        problem = f"tensor {min(needed - set(tensors))} is missing"
    elif not all(np.isfinite(value).all() for value in tensors.values()):
        problem = "a weight is not a finite number"
    elif tensors["weight/0"].shape[0] != len(layout.labels):
        problem = f"{tensors['weight/0'].shape[0]} policies for {len(layout.labels)} labels"
    elif tensors[f"weight/{layers - 1}"].shape[2] != len(layout.action_names):
        problem = "the last layer does not give one output per action"
    elif tensors["indices"].shape[0] != tensors["weight/0"].shape[1] or (
        tensors["indices"].size and int(tensors["indices"].max()) >= len(layout.observation_names)
    ):
        problem = "the first layer does not go with the observation"
    if problem:
        raise UserError(f"{where}: damaged checkpoint ({problem}); use another one")


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
        If `data` is no checkpoint of this package or of another format version.
    """
    try:
        length = int.from_bytes(data[:8], "little")
        if not 0 < length <= len(data) - 8:
            raise ValueError
        header = json.loads(data[8 : 8 + length])
        content: dict[str, Any] = json.loads(header["__metadata__"][HEADER_KEY])
        version = content["format"]
    except (ValueError, KeyError, TypeError):
        raise UserError(f"{where}: not a checkpoint of msrd_ros; give one that the trainer wrote") from None
    if version != FORMAT_VERSION:
        raise UserError(f"{where}: checkpoint format {version}, this version reads {FORMAT_VERSION}; retrain")
    return content
