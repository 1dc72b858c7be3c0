"""Parameter files that a node is started with: one that says nothing to it is not passed over in silence."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from msrd_ros.core.errors import UserError

_VALUES = "ros__parameters"


def given_files(words: Sequence[str]) -> list[Path]:
    """Files that a command line gives with --params-file."""
    return [Path(value) for word, value in pairwise(words) if word == "--params-file"]


def require_section(file: Path, node: str, others: Collection[str]) -> str:
    """Refuse a parameter file that has nothing for a node: ROS would start the node with its defaults.

    Parameters
    ----------
    file
        As ROS reads it.
    node
        Full name, such as ``/left/executor``.
    others
        Names of nodes that a file may be meant for as well.

    Returns
    -------
    Empty if a section is for this node; what to say where all of them are for others.

    Raises
    ------
    UserError
        If a section was meant for this node (it has its name, in another namespace) or for nobody that is
        known; names the file, its sections and how they would have to be called.
    """
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise UserError(f"parameter file {file}: cannot be read ({reason}); mend it or leave it") from None
    names = list(_sections(content, ""))
    if not names or any(_is_for(name, node) for name in names):
        return ""
    said = f"parameter file {file}: nothing in it is for {node}: it has {', '.join(names)}"
    called = {name.rpartition("/")[2] for name in names}
    if node.rpartition("/")[2] in called or not called & set(others):
        raise UserError(f"{said}; call the section /** (for any node) or {node}")
    return said


def _sections(content: Any, above: str) -> Iterator[str]:
    """Names of nodes, which may be written level by level: ``left: {executor: {ros__parameters: ...}}``."""
    if not isinstance(content, dict):
        return
    for key, value in content.items():
        if key == _VALUES:
            yield above
        else:
            yield from _sections(value, f"{above}/{str(key).strip('/')}")


def _is_for(section: str, node: str) -> bool:
    """Whether ROS takes a section for a node: ``/**`` is any names in a row, ``/*`` is one."""
    pattern = re.escape(section).replace(r"/\*\*", r"(/\w+)*").replace(r"\*", r"\w+")
    return re.fullmatch(pattern, node) is not None
