"""Made-up demonstrations whose strategies are known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = 120


def linear_demonstrations(
    strategies: int, each: int, seed: int = 0, noise: float = 0.2
) -> tuple[list[Array], list[Array], list[str]]:
    """Demonstrations of linear policies on a stable system of 3 columns and 2 actions, in mixed order.

    Those of a strategy follow one policy; all visit much the same states.
    """
    rng = np.random.default_rng([seed, strategies])
    gains = rng.normal(size=(strategies, 3, 2))
    owners = rng.permutation(np.repeat(np.arange(strategies), each))
    observations, actions = [], []
    for owner in owners:
        states = [rng.normal(size=3)]
        for _ in range(STEPS):
            states.append(0.9 * states[-1] + 0.5 * rng.normal(size=3))
        seen = np.array(states)
        observations.append(seen)
        actions.append(seen[:-1] @ gains[owner] + noise * rng.normal(size=(STEPS, 2)))
    return observations, actions, [f"way-{owner}" for owner in owners]


def reaching_demonstrations(
    strategies: int, each: int, seed: int = 0
) -> tuple[list[Array], list[Array], list[str]]:
    """Reaching along an arc to a side, every demonstration along one of its own, faster or slower.

    Those of a strategy go to the same side, but do not follow one policy.
    """
    rng = np.random.default_rng([seed, strategies])
    owners = rng.permutation(np.repeat(np.arange(strategies), each))
    observations, actions = [], []
    for owner in owners:
        angle = 2.0 * np.pi * owner / strategies + 0.12 * rng.normal()
        bend, length, pace = 0.3 * rng.normal(), 1.0 + 0.1 * rng.normal(), 1.0 + 0.1 * rng.normal()
        time = np.linspace(0.0, 1.0, STEPS + 1)
        way = np.clip(time * pace, 0.0, 1.0)
        heading = angle + bend * (1.0 - way)
        place = (
            length * np.stack([np.cos(heading), np.sin(heading)], axis=1) * (3 * way**2 - 2 * way**3)[:, None]
        )
        seen = place + 0.005 * rng.normal(size=place.shape)
        observations.append(seen)
        actions.append(np.diff(place, axis=0) * STEPS + 0.02 * rng.normal(size=(STEPS, 2)))
    return observations, actions, [f"side-{owner}" for owner in owners]


def same_partition(one: object, other: object) -> bool:
    """Whether two labellings have the same groups, whatever they are called."""
    pairs = set(zip(one, other, strict=True))  # type: ignore[call-overload]
    return len(pairs) == len({first for first, _ in pairs}) == len({second for _, second in pairs})
