"""Strategy labels: ``<side>-<stroke>``, as they travel in message headers.

This module owns parsing and formatting: nothing else takes a label apart, and no text becomes part of
a path before it has passed `StrategyLabel.parse`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from msrd_ros.core.errors import UserError


class Side(StrEnum):
    """Side of the paddle that meets the ball."""

    FOREHAND = "forehand"
    BACKHAND = "backhand"


class Stroke(StrEnum):
    """Stroke of table tennis, told apart by the spin it puts on the ball."""

    PUSH = "push"
    SLICE = "slice"
    TOPSPIN = "topspin"


@dataclass(frozen=True, order=True)
class StrategyLabel:
    """One of the six strategies, for example ``forehand-topspin``."""

    side: Side
    stroke: Stroke

    def __str__(self) -> str:
        return f"{self.side.value}-{self.stroke.value}"

    @classmethod
    def parse(cls, text: str, where: str = "strategy label") -> StrategyLabel:
        """Read a label.

        Parameters
        ----------
        text
            For example ``backhand-slice``.
        where
            What to blame in the error, for example ``topic strategy`` or a bag's path.

        Raises
        ------
        UserError
            If `text` is none of the six labels.
        """
        side, _, stroke = text.partition("-")
        try:
            return cls(Side(side), Stroke(stroke))
        except ValueError:
            known = ", ".join(str(label) for label in ALL_LABELS)
            raise UserError(f"{where}: unknown strategy label {text!r}; use one of {known}") from None

    @classmethod
    def parse_optional(cls, text: str) -> StrategyLabel | None:
        """Read a label from a field that may also hold something else, such as a TF frame."""
        try:
            return cls.parse(text)
        except UserError:
            return None


ALL_LABELS: tuple[StrategyLabel, ...] = tuple(
    StrategyLabel(side, stroke) for side in Side for stroke in Stroke
)
