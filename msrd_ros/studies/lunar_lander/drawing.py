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
    wanted = round(BELOW_SHARE * count), round(ABOVE_SHARE * count)
    chosen = [_draw_kind(np.flatnonzero(low), source, wanted[0], rng)]
    chosen.append(_draw_kind(np.flatnonzero(high), source, wanted[1], rng))
    chosen.append(
        _draw_kind(np.flatnonzero(middle & ~low & ~high), source, count - sum(map(len, chosen)), rng)
    )
    left = np.setdiff1d(np.arange(len(truth)), np.concatenate(chosen))
    chosen.append(_draw_kind(left, source, count - sum(map(len, chosen)), rng))
    return np.sort(np.concatenate(chosen))


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
