"""The study's tables, once for its report and once as Markdown for documents."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from msrd_ros.core.files import write_text
from msrd_ros.studies.table_tennis.methods import METHODS
from msrd_ros.studies.table_tennis.results import pooled


class Table(NamedTuple):
    """Head, rows of as many texts, and what they are."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str

    def markdown(self) -> str:
        """As GitHub writes tables, the caption below."""
        lines = [self.head, ["---"] * len(self.head), *self.rows]
        table = "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
        return f"{table}\n\n{self.caption}\n"


def share(part: dict[str, Any]) -> str:
    """A pooled share with its interval, in percent."""
    if part["share"] is None:
        return "-"
    low, high = part["interval"]
    return f"{100 * part['share']:.1f} ({100 * low:.1f} to {100 * high:.1f})"


def overall(method: dict[str, Any], name: str, total: str) -> dict[str, Any]:
    """A rate pooled over labels and seeds."""
    rows = method["labels"].values()
    return pooled(
        [count for row in rows for count in row[name]], [count for row in rows for count in row[total]]
    )


def worst(method: dict[str, Any], name: str) -> tuple[float, str] | None:
    """The lowest pooled share and its label."""
    shares = ((row["pooled"][name]["share"], label) for label, row in method["labels"].items())
    return min((pair for pair in shares if pair[0] is not None), default=None)


def worst_text(method: dict[str, Any], name: str) -> str:
    """`worst`, in percent."""
    found = worst(method, name)
    return "-" if found is None else f"{100 * found[0]:.1f} ({found[1]})"


def misses(method: dict[str, Any]) -> int:
    """Balls fed and not returned."""
    return sum(sum(row["fed"]) - sum(row["returned"]) for row in method["labels"].values())


def methods_table(metrics: dict[str, Any]) -> Table:
    """Every method in one row."""
    rows = [
        [
            METHODS[name].title,
            share(overall(method, "struck", "fed")),
            share(overall(method, "returned", "fed")),
            worst_text(method, "returned"),
            f"{misses(method)} of {sum(sum(row['fed']) for row in method['labels'].values())}",
            share(overall(method, "within_20cm", "returned")),
            share(overall(method, "spin_class_right", "returned")),
            f"{np.mean(method['training_cpu_seconds']):.0f}",
        ]
        for name, method in metrics["methods"].items()
    ]
    return Table(
        [
            "method",
            "struck, %",
            "returned, %",
            "worst stroke returned, %",
            "not returned",
            "landed within 20 cm, %",
            "spin right, %",
            "processor s",
        ],
        rows,
        "Percent with Wilson 95 % intervals, all strokes and seeds together, on the same balls for every "
        "method with as many. Within 20 cm of where the demonstrations land on average, and spin: of "
        "returned balls. Rows with fewer balls are of the first seed.",
    )


def robustness_table(metrics: dict[str, Any]) -> Table:
    """Every condition in one row, every method in one column."""
    found = metrics["robustness"]
    conditions: dict[str, Any] = next(iter(found.values()), {})
    rows = [[condition, *(_cell(rows[condition]) for rows in found.values())] for condition in conditions]
    fed = {
        METHODS[name].title: sum(sum(row["fed"]) for row in next(iter(rows.values()))["labels"].values())
        for name, rows in found.items()
    }
    return Table(
        ["condition", *(METHODS[name].title for name in found)],
        rows,
        "Balls returned / returned by the worst stroke / landed within 20 cm of where the demonstrations "
        "land, of those returned; percent. Balls in each cell: "
        + ", ".join(f"{title} {count}" for title, count in fed.items())
        + ".",
    )


def _cell(row: dict[str, Any]) -> str:
    returned = overall(row, "returned", "fed")
    near = overall(row, "within_20cm", "returned")["share"]
    lowest = worst(row, "returned")
    return " / ".join(
        "-" if value is None else f"{100 * value:.{digits}f}"
        for value, digits in ((returned["share"], 1), (lowest and lowest[0], 0), (near, 0))
    )


def write_tables(metrics: dict[str, Any], folder: Path) -> None:
    """Write ``tables.md`` into `folder`."""
    tables = [methods_table(metrics)]
    if metrics["robustness"]:
        tables.append(robustness_table(metrics))
    write_text(folder / "tables.md", "\n".join(table.markdown() for table in tables))
