"""What discovery says: which strategies there are, whose a demonstration is, which labels are doubted."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.files import write_atomically


@dataclass(frozen=True)
class Discovery:
    """Strategies of N demonstrations.

    Attributes
    ----------
    names
        Of the K strategies, in the order in which they first appear: that of the given label which most of a
        strategy's labelled demonstrations have, else ``strategy-1`` and so on.
    assignment
        ``[N]``, the strategy of each demonstration.
    beliefs
        ``[N, K]``, probability of each strategy for a demonstration, given where the others are; what a row
        lacks of 1 is that of a strategy of its own.
    doubted
        Demonstrations whose given label is more likely wrong than right.
    given
        Labels that came with the demonstrations, None where there was none.
    sources
        Where demonstrations come from, such as bags; empty: they are known by their numbers.
    one_policy
        Whether the demonstrations of a strategy were found to follow one policy; otherwise they differ as
        those of several teachers do, and were told apart by their courses.
    """

    names: tuple[str, ...]
    assignment: NDArray[np.int64]
    beliefs: NDArray[np.float64]
    doubted: tuple[int, ...]
    given: tuple[str | None, ...]
    sources: tuple[str, ...] = ()
    one_policy: bool = True

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each demonstration's strategy: labels to train with."""
        return tuple(self.names[index] for index in self.assignment)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: ``strategies`` with the demonstrations of each by name, and ``doubted``."""
        strategies: dict[str, list[dict[str, Any]]] = {name: [] for name in self.names}
        for number, name in enumerate(self.labels):
            strategies[name].append({**self._which(number), "belief": self._belief(number)})
        doubted = [
            {
                **self._which(number),
                "label": self.given[number],
                "strategy": self.labels[number],
                "belief": self._belief(number),
            }
            for number in self.doubted
        ]
        return {"strategies": strategies, "doubted": doubted}

    def save(self, path: str | Path) -> None:
        """Write `to_dict` to a file, ``strategies.json`` by custom; a person renames its strategies.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        write_atomically(Path(path), (json.dumps(self.to_dict(), indent=2) + "\n").encode())

    def _which(self, number: int) -> dict[str, Any]:
        return {"bag": self.sources[number]} if self.sources else {"index": number}

    def _belief(self, number: int) -> float:
        return round(float(self.beliefs[number, self.assignment[number]]), 4)
