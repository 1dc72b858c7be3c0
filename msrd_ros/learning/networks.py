"""Many small tanh networks side by side, one batched matrix product per layer.

All strategies' networks have the same shape, so their weights are stacked along a leading axis and one
``baddbmm`` serves them all. `Linearisation` offers the two halves of a Gauss-Newton product (tangent forward,
cotangent backward) that the natural gradient needs, without autograd's overhead.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import torch
from torch import Tensor, nn


class BatchedMLP(nn.Module):
    """`copies` multi-layer perceptrons with tanh hidden layers and a linear output.

    Parameters
    ----------
    copies
        Number of networks side by side, S.
    sizes
        Widths from input to output, for example ``(13, 32, 32, 1)``.
    generator
        Source of the initial weights (Xavier uniform, zero biases).
    output_gain
        Factor on the last layer's initial weights; small values start policies near zero.
    """

    __call__: Callable[..., Tensor]  # torch says Any

    def __init__(
        self, copies: int, sizes: tuple[int, ...], generator: torch.Generator, output_gain: float = 1.0
    ) -> None:
        super().__init__()
        self.copies = copies
        self.sizes = tuple(sizes)
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for layer, (fan_in, fan_out) in enumerate(pairwise(self.sizes)):
            bound = (6.0 / (fan_in + fan_out)) ** 0.5
            if layer == len(self.sizes) - 2:
                bound *= output_gain
            weight = torch.empty(copies, fan_in, fan_out).uniform_(-bound, bound, generator=generator)
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(torch.zeros(copies, 1, fan_out)))

    @property
    def parameter_count(self) -> int:
        """Number of parameters of one network, P."""
        return sum(fan_in * fan_out + fan_out for fan_in, fan_out in pairwise(self.sizes))

    def forward(self, inputs: Tensor, rows: Tensor | None = None) -> Tensor:
        """Map ``inputs [S, N, sizes[0]]`` to ``[S, N, sizes[-1]]``.

        Parameters
        ----------
        inputs
            One row of samples for each network.
        rows
            Which network each row of `inputs` goes through, ``[R]``; then `inputs` has R rows, and so has
            the result.
        """
        hidden = inputs
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if rows is not None:
                weight, bias = weight[rows], bias[rows]
            hidden = torch.baddbmm(bias, hidden, weight)
            if layer < last:
                hidden = torch.tanh(hidden)
        return hidden

    def flat(self) -> Tensor:
        """Parameters of every network in one row each, ``[S, P]``, detached."""
        pairs = zip(self.weights, self.biases, strict=True)
        return torch.cat([part.detach().flatten(1) for pair in pairs for part in pair], dim=1)

    def set_flat(self, flat: Tensor) -> None:
        """Overwrite all parameters from ``flat [S, P]``, the order of `flat`."""
        with torch.no_grad():
            parts = self.split(flat)
            for weight, bias, (new_weight, new_bias) in zip(self.weights, self.biases, parts, strict=True):
                weight.copy_(new_weight)
                bias.copy_(new_bias)

    def split(self, flat: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Weights and biases of every layer as views of ``flat [S, P]``."""
        pieces: list[tuple[Tensor, Tensor]] = []
        start = 0
        for fan_in, fan_out in pairwise(self.sizes):
            middle, end = start + fan_in * fan_out, start + fan_in * fan_out + fan_out
            weight = flat[:, start:middle].reshape(self.copies, fan_in, fan_out)
            pieces.append((weight, flat[:, middle:end].reshape(self.copies, 1, fan_out)))
            start = end
        return pieces


class Linearisation:
    """Networks about some inputs: what they say there, and products with their Jacobian.

    The Jacobian is that of the outputs with respect to the parameters, at the inputs and for the parameters
    that were given.

    Parameters
    ----------
    network
        S networks.
    inputs
        ``[S, N, sizes[0]]``.

    Attributes
    ----------
    outputs
        ``[S, N, sizes[-1]]``.
    """

    @torch.no_grad()
    def __init__(self, network: BatchedMLP, inputs: Tensor) -> None:
        self._network = network
        self._weights = [weight.detach() for weight in network.weights]
        self._inputs = [inputs]
        for weight, bias in zip(self._weights[:-1], network.biases, strict=False):
            self._inputs.append(torch.baddbmm(bias, self._inputs[-1], weight).tanh_())
        self.outputs = torch.baddbmm(network.biases[-1], self._inputs[-1], self._weights[-1])
        self._slopes = [1.0 - hidden.square() for hidden in self._inputs[1:]]

    @torch.no_grad()
    def push_forward(self, tangent: Tensor) -> Tensor:
        """The Jacobian times a direction ``tangent [S, P]`` of flat parameters: ``[S, N, sizes[-1]]``."""
        # In place: fresh memory for tensors of this size costs as much as the sums.
        moved: Tensor | None = None
        for layer, (d_weight, d_bias) in enumerate(self._network.split(tangent)):
            change = torch.baddbmm(d_bias, self._inputs[layer], d_weight)
            if moved is not None:
                torch.baddbmm(change, moved, self._weights[layer], out=change)
            if layer < len(self._slopes):
                change.mul_(self._slopes[layer])
            moved = change
        assert moved is not None
        return moved

    @torch.no_grad()
    def pull_back(self, cotangent: Tensor) -> Tensor:
        """The transposed Jacobian times ``cotangent [S, N, sizes[-1]]``: flat gradients ``[S, P]``."""
        parts: list[Tensor] = []
        for layer in range(len(self._weights) - 1, -1, -1):
            parts.append(cotangent.sum(dim=1))
            parts.append(torch.bmm(self._inputs[layer].transpose(1, 2), cotangent).flatten(1))
            if layer > 0:
                cotangent = torch.bmm(cotangent, self._weights[layer].transpose(1, 2))
                cotangent.mul_(self._slopes[layer - 1])
        return torch.cat(parts[::-1], dim=1)


class Features(nn.Module):
    """Chosen columns of an observation, shifted and scaled: ``(x[indices] - offset) / scale``.

    Parameters
    ----------
    indices
        Columns of the observation to keep.
    offset, scale
        One value per kept column, in the column's own unit.
    """

    indices: Tensor
    offset: Tensor
    scale: Tensor

    __call__: Callable[..., Tensor]  # torch says Any

    def __init__(self, indices: tuple[int, ...], offset: tuple[float, ...], scale: tuple[float, ...]) -> None:
        super().__init__()
        self._whole = tuple(indices)
        self.register_buffer("indices", torch.tensor(indices, dtype=torch.int64))
        self.register_buffer("offset", torch.tensor(offset, dtype=torch.float32))
        self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))

    @property
    def width(self) -> int:
        """Number of features."""
        return len(self._whole)

    @property
    def highest(self) -> int:
        """The last column that is looked at."""
        return max(self._whole, default=-1)

    def forward(self, observations: Tensor) -> Tensor:
        """Map ``[..., O]`` to ``[..., width]``."""
        if self._whole != tuple(range(observations.shape[-1])):
            observations = observations.index_select(-1, self.indices)
        return (observations - self.offset) / self.scale
