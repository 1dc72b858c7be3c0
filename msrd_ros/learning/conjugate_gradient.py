"""Conjugate gradient for many symmetric positive definite systems side by side."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


@torch.no_grad()
def conjugate_gradient(
    product: Callable[[Tensor], Tensor], right_hand_side: Tensor, iterations: int, tolerance: float = 1e-10
) -> Tensor:
    """Solve ``A_i x_i = b_i`` for every row i, given only products with A.

    Parameters
    ----------
    product
        Maps ``[S, P]`` to ``[S, P]``, row i multiplied by A_i.
    right_hand_side
        ``[S, P]``.
    iterations
        Most steps to take; P steps solve exactly but for rounding.
    tolerance
        Rows whose squared residual is below this times ``|b_i|^2`` are left as they are.

    Returns
    -------
    Tensor
        ``[S, P]``.
    """
    solution = torch.zeros_like(right_hand_side)
    residual = right_hand_side.clone()
    direction = residual.clone()
    size = residual.square().sum(dim=1, keepdim=True)
    enough = tolerance * size
    for _ in range(iterations):
        busy = size > enough
        if not bool(busy.any()):
            break
        image = product(direction)
        curvature = (direction * image).sum(dim=1, keepdim=True)
        step = torch.where(busy & (curvature > 0.0), size / curvature, torch.zeros_like(size))
        solution = solution + step * direction
        residual = residual - step * image
        new_size = residual.square().sum(dim=1, keepdim=True)
        ratio = torch.where(busy, new_size / size.clamp(min=1e-38), torch.zeros_like(size))
        direction = residual + ratio * direction
        size = torch.where(busy, new_size, size)
    return solution
