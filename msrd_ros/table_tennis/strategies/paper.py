"""The six strategies of the paper: what the synthetic teachers show and the table tennis study learns.

They are names like any other; only those who plan or teach them need to know of side and stroke apart.
"""

from __future__ import annotations

from enum import StrEnum

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.table_tennis.strategies.table import Side


class Stroke(StrEnum):
    """Stroke of table tennis, told apart by the spin it puts on the ball."""

    PUSH = "push"
    SLICE = "slice"
    TOPSPIN = "topspin"


class PaperLabel(StrategyLabel):
    """The label of one of the six, for example ``forehand-topspin``.

    Attributes
    ----------
    side, stroke
        What it is made of.
    """

    side: Side
    stroke: Stroke

    def __new__(cls, side: Side, stroke: Stroke) -> PaperLabel:
        """Name a side's stroke."""
        label = str.__new__(cls, f"{side.value}-{stroke.value}")
        label.side, label.stroke = side, stroke
        return label

    def __reduce__(self) -> tuple[type[PaperLabel], tuple[Side, Stroke]]:
        return PaperLabel, (self.side, self.stroke)


ALL_LABELS: tuple[PaperLabel, ...] = tuple(PaperLabel(side, stroke) for side in Side for stroke in Stroke)
