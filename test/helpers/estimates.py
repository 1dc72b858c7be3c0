"""Comparing what two estimates of rewards say."""

from __future__ import annotations

import torch

from msrd_ros.studies.shared.estimates import Estimate


def require_alike(first: Estimate, second: Estimate, states: torch.Tensor) -> None:
    """Both know the same rewards, at least one, and say the same of states ``[..., O]``."""
    compared = 0
    for name in ("task", "strategies", "combined"):
        one, other = getattr(first, name), getattr(second, name)
        assert (one is None) == (other is None), name
        if one is not None:
            torch.testing.assert_close(other(states), one(states))
            compared += 1
    assert compared
