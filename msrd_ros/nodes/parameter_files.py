"""`python -m msrd_ros.nodes.parameter_files`: write config/ anew from what the nodes declare.

The dataclasses are the one place where a parameter's default, unit and range stand; the files repeat them for
users to copy and change, and a test holds both together.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import sys
import textwrap
from typing import Any

from msrd_ros.core.parameters import ParameterFacts
from msrd_ros.core.resources import share_directory

NODES = (
    "simulator",
    "demonstrator",
    "recorder",
    "player",
    "trainer",
    "executor",
    "evaluator",
    "match",
    "chooser",
    "studio",
)
ROOMS = {"studio": "studio"}
"""Of the nodes that do not live in room `nodes`."""
WIDTH = 96


def node_type(node: str) -> type[Any]:
    """Class of a node."""
    return _class_of(node, node.capitalize())


def config_type(node: str) -> type[Any]:
    """Dataclass of a node's parameters."""
    return _class_of(node, f"{node.capitalize()}Config")


def _class_of(node: str, name: str) -> type[Any]:
    found: type[Any] = getattr(importlib.import_module(f"msrd_ros.{ROOMS.get(node, 'nodes')}.{node}"), name)
    return found


def parameter_file(node: str) -> str:
    """Text of ``config/<node>.yaml``: every parameter at its default, with what it means."""
    lines = [
        f"# Parameters of `{node}`, all at their defaults. Copy what you change, and start it with",
        f"#   ros2 run msrd_ros {node} --ros-args --params-file FILE",
        f"# /** is for a node of any name in any namespace; in a file for several nodes say /**/{node}.",
        "/**:",
        "  ros__parameters:",
    ]
    defaults = config_type(node)()
    for field in dataclasses.fields(defaults):
        meaning = _meaning(field.metadata["parameter"])
        lines += [f"    # {line}" for line in textwrap.wrap(meaning, WIDTH)]
        default = getattr(defaults, field.name)
        # ROS reads no empty list: it would have no type.
        lines.append(
            f"    # {field.name}: [...]" if default == [] else f"    {field.name}: {json.dumps(default)}"
        )
    return "\n".join(lines) + "\n"


def _meaning(facts: ParameterFacts) -> str:
    unit = f" [{facts.unit}]" if facts.unit else ""
    sentences = [f"{facts.description.rstrip('.')}{unit}."]
    if facts.live:
        sentences.append("May be set while it runs.")
    if facts.choices:
        sentences.append(f"One of: {', '.join(facts.choices)}.")
    if facts.low is not None and facts.high is not None:
        sentences.append(f"From {facts.low:.10g} to {facts.high:.10g}.")
    elif facts.low is not None:
        sentences.append(f"At least {facts.low:.10g}.")
    elif facts.high is not None:
        sentences.append(f"At most {facts.high:.10g}.")
    return " ".join(sentences)


def main() -> int:
    """Write all files."""
    for node in NODES:
        path = share_directory() / "config" / f"{node}.yaml"
        path.write_text(parameter_file(node), encoding="utf-8")
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
