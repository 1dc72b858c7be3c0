"""What LeRobot's and Minari's data sets have in common: episodes with rows of numbers, feature by feature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from msrd_ros.contract.episode import Episode


class TableEpisode(NamedTuple):
    """One episode.

    Attributes
    ----------
    number
        In the data set.
    task
        What it says it shows; empty if it does not say.
    rows
        By feature: shape (T, width).
    facts
        What else is said of it.
    """

    number: int
    task: str
    rows: Mapping[str, NDArray[Any]]
    facts: Mapping[str, Any]


class Table(Protocol):
    """A data set that is read.

    Attributes
    ----------
    where
        What to blame in errors.
    rate_hz
        Rows a second; None if it does not say.
    """

    where: str
    rate_hz: float | None

    def entry_names(self, feature: str) -> list[str] | None:
        """Names of a feature's entries; None where there are none.

        Raises
        ------
        UserError
            If there is no such feature.
        """
        ...

    def width(self, feature: str) -> int:
        """How many entries a feature has."""
        ...

    def episodes(self, features: list[str]) -> list[TableEpisode]:
        """All episodes with the rows of some features."""
        ...

    def of_stroke(self, episode: Episode) -> Mapping[str, NDArray[Any]]:
        """The rows that an exported stroke has in a data set of this kind, bit for bit."""
        ...
