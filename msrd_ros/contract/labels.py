"""Strategy labels: the names of strategies, as they travel in message headers.

This module owns what a well-formed name is; what is known of a strategy beside its name is the task's matter.
No text becomes part of a path before it has become a `StrategyLabel`.
"""

from __future__ import annotations

import re

from msrd_ros.core.errors import UserError

_WELL_FORMED = re.compile(r"[a-z0-9-]{1,64}")

FRAME_NAMES = frozenset({"world", "base", "map", "odom", "earth"})
"""Frames that drivers and TF call so everywhere: none of them is taken for a strategy."""

UNLABELLED = "unlabelled"
"""What people and names of bags say of a stroke without a label; headers and metadata leave it empty."""

WITHOUT_LABEL = (
    "no strategy label; give it one with python -m msrd_ros.bags relabel BAG LABEL, or have strategies "
    "found with labels:=discover"
)
"""Why a stroke without a label is no demonstration of a strategy, and the ways out."""


class StrategyLabel(str):
    """The name of a strategy: 1 to 64 of a-z, 0-9 and hyphen, no common frame's name, not `UNLABELLED`.

    Raises
    ------
    UserError
        If the text is no such name.
    """

    __slots__ = ()

    def __new__(cls, text: str) -> StrategyLabel:
        """Read a label; see `parse`."""
        return cls.parse(text)

    @classmethod
    def parse(cls, text: str, where: str = "strategy label") -> StrategyLabel:
        """Read a label.

        Parameters
        ----------
        text
            For example ``my-smash``.
        where
            What to blame in the error, for example ``topic strategy`` or a bag's path.

        Raises
        ------
        UserError
            If `text` is no well-formed name.
        """
        if not _WELL_FORMED.fullmatch(text):
            raise UserError(
                f"{where}: {text!r} is no strategy label; use 1 to 64 of a-z, 0-9 and hyphen, as in my-smash"
            )
        if text in FRAME_NAMES:
            raise UserError(f"{where}: {text!r} is a frame's name and no strategy label; choose another")
        if text == UNLABELLED:
            raise UserError(f"{where}: {text!r} is said of strokes without a label; choose another name")
        return str.__new__(cls, text)

    @classmethod
    def parse_optional(cls, text: str) -> StrategyLabel | None:
        """Read a label from a field that may also hold something else, such as a TF frame."""
        try:
            return cls.parse(text)
        except UserError:
            return None


def say_label(label: StrategyLabel | None) -> str:
    """A stroke's label as people and names of bags say it; `UNLABELLED` if it has none."""
    return UNLABELLED if label is None else str(label)


def read_label(text: str, where: str = "strategy label") -> StrategyLabel | None:
    """Read what `say_label` says; None for no text at all, too.

    Raises
    ------
    UserError
        If the text is neither a well-formed name nor `UNLABELLED`.
    """
    return None if text in ("", UNLABELLED) else StrategyLabel.parse(text, where)
