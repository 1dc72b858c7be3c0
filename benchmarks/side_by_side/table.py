"""The table of `make benchmarks`: one line for each comparison, with its ratio."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

HEAD = ("what", "ours", "beside", "theirs", "ratio")


@dataclass(frozen=True)
class Comparison:
    """One line: the same work, done by us and by somebody else.

    Attributes
    ----------
    what
        What was measured.
    unit
        Of both values.
    ours
        Our value; NaN if it was not reached.
    beside
        With whom or what it is compared, version included; empty if there is nobody.
    theirs
        Their value; NaN if it was not reached, or nobody is there.
    less_is_better
        Whether the smaller value is the better one, as of times.
    note
        How it was asked, or why there is no value.
    """

    what: str
    unit: str
    ours: float
    beside: str = ""
    theirs: float = math.nan
    less_is_better: bool = False
    note: str = ""

    @property
    def ratio(self) -> float:
        """How many times better ours is; below 1 theirs is better, NaN without two values."""
        if not (self.ours > 0.0 and self.theirs > 0.0):
            return math.nan
        return self.theirs / self.ours if self.less_is_better else self.ours / self.theirs


def number(value: float) -> str:
    """Three significant digits without an exponent; a dash where there is no value."""
    if math.isnan(value):
        return "–"
    if value == 0.0:
        return "0"
    return f"{value:,.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def markdown(comparisons: Iterable[Comparison], head: str) -> str:
    """The table under a line that says where and when, notes below it, numbered as they come.

    Parameters
    ----------
    comparisons
        Its lines, in this order.
    head
        Machine, load and time.
    """
    notes: list[str] = []
    rows = [HEAD, ("---",) * len(HEAD)]
    for line in comparisons:
        mark = ""
        if line.note:
            if line.note not in notes:
                notes.append(line.note)
            mark = f" ({notes.index(line.note) + 1})"
        ours, theirs = (
            "–" if math.isnan(value) else f"{number(value)} {line.unit}" for value in (line.ours, line.theirs)
        )
        rows.append((line.what + mark, ours, line.beside or "–", theirs, number(line.ratio)))
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    told = "\n".join(f"{index}. {note}" for index, note in enumerate(notes, 1))
    meaning = "Ratio: how many times better ours is; below 1 the other is."
    return "\n\n".join(part for part in (head, meaning, table, told) if part) + "\n"
