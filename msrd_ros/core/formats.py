"""Versions of file formats: what a newer msrd_ros wrote is refused by name, what an older one wrote is read.

A version counts up when a reader of the one before would misunderstand what is written. Files without one are
of 0.1.0, or written by hand: they are of version 1.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_text

FORMAT_KEY = "format"
FIRST_FORMAT = 1
REPORT_FORMAT = 1
"""Of ``training.json``, the evaluator's report and ``metrics.json``."""

_REPORT_NAMES = {"sweep": "iteration", "sweeps": "iterations"}
"""Names of 0.1.0, and what they are called now."""


def require_format(found: object, newest: int, where: str) -> None:
    """Refuse what this version cannot read.

    Parameters
    ----------
    found
        The version that a file states; text that is a number will do.
    newest
        The highest one that is read here.
    where
        File or topic, to blame.

    Raises
    ------
    UserError
        If it is higher, or no version at all; says what to do.
    """
    text = str(found)
    if not re.fullmatch("[1-9][0-9]{0,8}", text):
        raise UserError(f"{where}: format {found!r} is no version; write {newest}, or use another file")
    if int(text) > newest:
        raise UserError(
            f"{where}: is of format {text}, which a newer msrd_ros wrote, and this one reads up to {newest}; "
            "upgrade msrd_ros, or use a file that this version wrote"
        )


def renamed(node: Any, names: Mapping[str, str]) -> Any:
    """Nested data with its keys under the names that they have now."""
    if isinstance(node, dict):
        return {names.get(key, key): renamed(value, names) for key, value in node.items()}
    return [renamed(value, names) for value in node] if isinstance(node, list) else node


def write_report(path: Path, content: Mapping[str, Any]) -> None:
    """Write figures as JSON, with the version of their format before them.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_text(path, json.dumps({FORMAT_KEY: REPORT_FORMAT, **content}, indent=1) + "\n")


def read_report(path: Path) -> dict[str, Any]:
    """Inverse of `write_report`; reports of 0.1.0, which state no format, come under present names.

    Raises
    ------
    UserError
        If the file cannot be read, is no report, or is of a newer format.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: no readable report ({error}); make it anew, or give another") from None
    if not isinstance(content, dict):
        raise UserError(f"{path}: no report of msrd_ros (no map of figures); give another")
    if FORMAT_KEY not in content:
        return dict(renamed(content, _REPORT_NAMES))
    require_format(content.pop(FORMAT_KEY), REPORT_FORMAT, str(path))
    return content
