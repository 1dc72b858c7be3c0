"""Statistics of a data set as LeRobot keeps them: of every episode, and of all of them together.

Source: lerobot 0.4.4, `lerobot.datasets.compute_stats`. Its quantiles come from histograms of 5,000 bins;
here they are samples, so that the two differ by a bin at most. Those of the whole set are means of the
episodes', weighted by their lengths, there and here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)

Statistics = Mapping[str, NDArray[Any]]
"""`min`, `max`, `mean`, `std`, `count` and `q01` to `q99` of a feature, shape (width,); `count` (1,)."""


def episode_statistics(rows: NDArray[Any]) -> Statistics:
    """Statistics of a feature over the rows of an episode, shape (T, width)."""
    exact = rows.astype(np.float64)
    quantiles = np.quantile(exact, QUANTILES, axis=0, method="inverted_cdf")
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": exact.mean(axis=0),
        "std": exact.std(axis=0),
        "count": np.array([len(rows)]),
        **{_name(q): value for q, value in zip(QUANTILES, quantiles, strict=True)},
    }


def picture_statistics(frames: NDArray[np.uint8]) -> Statistics:
    """The same of pictures (T, height, width, 3): of each colour within [0, 1], shape (3, 1, 1)."""
    levels = np.arange(256) / 255.0
    counts = np.stack([np.bincount(frames[..., colour].reshape(-1), minlength=256) for colour in range(3)])
    shares = counts / counts.sum(axis=1, keepdims=True)
    below = shares.cumsum(axis=1)
    mean = shares @ levels
    found = {
        "min": levels[(counts > 0).argmax(axis=1)],
        "max": levels[255 - (counts[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt((shares * (levels - mean[:, None]) ** 2).sum(axis=1)),
        **{_name(q): levels[(below >= q - 1e-12).argmax(axis=1)] for q in QUANTILES},
    }
    shaped = {name: value.reshape(3, 1, 1) for name, value in found.items()}
    return {**shaped, "count": np.array([len(frames)])}


def pooled(parts: Sequence[Statistics]) -> Statistics:
    """Statistics of all episodes together, from those of each."""
    counts = np.array([int(part["count"][0]) for part in parts])

    def mean(values: Sequence[NDArray[Any]]) -> NDArray[np.float64]:
        return np.asarray(np.average(np.stack(values), axis=0, weights=counts))

    total = mean([part["mean"] for part in parts])
    variance = mean([part["std"] ** 2 + (part["mean"] - total) ** 2 for part in parts])
    names = [name for name in parts[0] if name[0] == "q"]
    return {
        "min": np.stack([part["min"] for part in parts]).min(axis=0),
        "max": np.stack([part["max"] for part in parts]).max(axis=0),
        "mean": total,
        "std": np.sqrt(variance),
        "count": np.array([counts.sum()]),
        **{name: mean([part[name] for part in parts]) for name in names},
    }


def _name(quantile: float) -> str:
    return f"q{round(100 * quantile):02d}"
