"""Many small tanh networks side by side, one batched matrix product per layer.

All strategies' networks have the same shape, so their weights are stacked along a leading axis and one
``baddbmm`` serves them all. Besides the forward pass the class offers the two halves of a Gauss-Newton
product (tangent forward, cotangent backward) that the natural gradient needs, without autograd's overhead.
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

    def activations(self, inputs: Tensor) -> list[Tensor]:
        """Input of every layer, and the output last: ``len(sizes)`` tensors ``[S, N, width]``."""
        tensors = [inputs]
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = torch.baddbmm(bias, tensors[-1], weight)
            tensors.append(torch.tanh(hidden) if layer < last else hidden)
        return tensors

    def push_forward(self, activations: list[Tensor], tangent: Tensor) -> Tensor:
        """Jacobian of the outputs with respect to the parameters, times `tangent`.

        Parameters
        ----------
        activations
            From `activations`, at the inputs of interest.
        tangent
            ``[S, P]``, a direction in the space of flat parameters.

        Returns
        -------
        Tensor
            ``[S, N, sizes[-1]]``.
        """
        last = len(self.weights) - 1
        moved: Tensor | None = None
        for layer, (d_weight, d_bias) in enumerate(self._split(tangent)):
            change = torch.baddbmm(d_bias, activations[layer], d_weight)
            if moved is not None:
                change = torch.baddbmm(change, moved, self.weights[layer])
            if layer < last:
                change = change * (1.0 - activations[layer + 1].square())
            moved = change
        assert moved is not None
        return moved

    def pull_back(self, activations: list[Tensor], cotangent: Tensor) -> Tensor:
        """Transposed Jacobian times `cotangent [S, N, sizes[-1]]`: flat gradients ``[S, P]``."""
        parts: list[Tensor] = []
        for layer in range(len(self.weights) - 1, -1, -1):
            if layer < len(self.weights) - 1:
                cotangent = cotangent * (1.0 - activations[layer + 1].square())
            parts.append(cotangent.sum(dim=1))
            parts.append(torch.bmm(activations[layer].transpose(1, 2), cotangent).flatten(1))
            if layer > 0:
                cotangent = torch.bmm(cotangent, self.weights[layer].transpose(1, 2))
        return torch.cat(parts[::-1], dim=1)

    def flat(self) -> Tensor:
        """Parameters of every network in one row each, ``[S, P]``, detached."""
        pairs = zip(self.weights, self.biases, strict=True)
        return torch.cat([part.detach().flatten(1) for pair in pairs for part in pair], dim=1)

    def set_flat(self, flat: Tensor) -> None:
        """Overwrite all parameters from ``flat [S, P]``, the order of `flat`."""
        with torch.no_grad():
            parts = self._split(flat)
            for weight, bias, (new_weight, new_bias) in zip(self.weights, self.biases, parts, strict=True):
                weight.copy_(new_weight)
                bias.copy_(new_bias)

    def _split(self, flat: Tensor) -> list[tuple[Tensor, Tensor]]:
        pieces: list[tuple[Tensor, Tensor]] = []
        start = 0
        for fan_in, fan_out in pairwise(self.sizes):
            middle, end = start + fan_in * fan_out, start + fan_in * fan_out + fan_out
            weight = flat[:, start:middle].reshape(self.copies, fan_in, fan_out)
            pieces.append((weight, flat[:, middle:end].reshape(self.copies, 1, fan_out)))
            start = end
        return pieces


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
