"""Which trajectories make a test set: so many of each kind and from each source, at random."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CRASHED_BELOW, LANDED_ABOVE = -5000.0, 1000.0
"""True returns that only trajectories have which crashed early, and which rested long."""
BELOW_SHARE, ABOVE_SHARE = 0.2, 0.1
"""How many of the published trajectories lie below and above."""


def draw(
    truth: NDArray[np.float64],
    middle: NDArray[np.bool_],
    source: NDArray[np.int64],
    count: int,
    rng: np.random.Generator,
) -> NDArray[np.int64]:
    """Rows of `count` trajectories with the published spread, equally many from each source if there are.

    All that is neither below nor above neither crashed nor rested, as nearly all of it in the published
    trajectories. Where a source has too few of a kind, the other sources make up for it; where all together
    have too few, whatever is left does, so that the spread that was reached has to be looked at.

    Parameters
    ----------
    truth, middle, source
        True return of each trajectory there is, whether it neither crashed nor rested, and where it comes
        from, ``[N]``.
    """
    low, high = truth < CRASHED_BELOW, truth > LANDED_ABOVE
    between = ~low & ~high
    kinds = [(low, round(BELOW_SHARE * count)), (high, round(ABOVE_SHARE * count)), (between & middle, count)]
    # What there is too little of: first by the late crashes and short rests, then by anything.
    kinds += [(between, count), (np.ones(len(truth), dtype=bool), count)]
    chosen = np.zeros(0, dtype=np.int64)
    for kind, most in kinds:
        left = np.setdiff1d(np.flatnonzero(kind), chosen)
        chosen = np.append(chosen, _draw_kind(left, source, min(most, count - len(chosen)), rng))
    return np.sort(chosen)


def _draw_kind(
    rows: NDArray[np.int64], source: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """At most `count` of `rows`, as equally from the sources as they go."""
    order = rng.permutation(rows)
    # The k-th row of a source comes in round k: whoever takes the first rounds takes from all alike.
    turn = np.empty(len(order), dtype=np.int64)
    for each in np.unique(source[order]):
        own = source[order] == each
        turn[own] = np.arange(own.sum())
    chosen: NDArray[np.int64] = order[np.argsort(turn, kind="stable")[:count]]
    return chosen
