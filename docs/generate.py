"""Write docs/generated/: topics, services and parameters of the nodes, and the picture of rooms."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import json
import re
from pathlib import Path

from msrd_ros.contract.interface import MEANINGS, TOPICS
from msrd_ros.core.parameters import ParameterFacts
from msrd_ros.nodes.managed import LIFECYCLE_SERVICES, ManagedNode
from msrd_ros.nodes.parameter_files import NODES, config_type, node_type

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "msrd_ros"
TARGET = ROOT / "docs" / "generated"
ROW, WIDTH, HEIGHT, MARGIN = 62, 190, 36, 24


def topics() -> str:
    """Table of all topics."""
    lines = ["| topic | type | kept | from → to |", "|---|---|---|---|"]
    for name, facts in TOPICS.items():
        kept = f"{facts.depth}{', transient local' if facts.latched else ''}"
        lines.append(f"| `{name}` | {facts.type_name} | {kept} | {MEANINGS[name]} |")
    return "\n".join(lines) + "\n"


def services() -> str:
    """Table of the services that the nodes' code creates, and of those that rclpy gives to managed nodes."""
    lines = ["| node | service | type |", "|---|---|---|"]
    for node in NODES:
        code = Path(inspect.getfile(node_type(node))).read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(code)):
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "self.create_service":
                kind, name = call.args[:2]
                lines.append(f"| {node} | `{ast.literal_eval(name)}` | std_srvs/srv/{ast.unparse(kind)} |")
    managed = ", ".join(node for node in NODES if issubclass(node_type(node), ManagedNode))
    for name, kind in LIFECYCLE_SERVICES.items():
        lines.append(f"| {managed} | `{name}` | lifecycle_msgs/srv/{kind} |")
    return "\n".join(lines) + "\n"


def parameters() -> str:
    """One table of parameters for each node."""
    parts = []
    for node in NODES:
        parts += [
            f"## {node}",
            "",
            "| parameter | default | range | set | meaning |",
            "|---|---|---|---|---|",
        ]
        defaults = config_type(node)()
        for field in dataclasses.fields(defaults):
            facts: ParameterFacts = field.metadata["parameter"]
            default = json.dumps(getattr(defaults, field.name))
            unit = f" [{facts.unit}]" if facts.unit else ""
            meaning = re.sub(r"([|<*_])", r"\\\1", f"{facts.description.rstrip('.')}{unit}")
            when = "live" if facts.live else "at start"
            parts.append(f"| `{field.name}` | `{default}` | {_range(facts)} | {when} | {meaning} |")
        parts.append("")
    return "\n".join(parts)


def _range(facts: ParameterFacts) -> str:
    if facts.choices:
        return ", ".join(f"`{choice}`" for choice in facts.choices if choice)
    low = "" if facts.low is None else f"≥ {facts.low:.10g}"
    high = "" if facts.high is None else f"≤ {facts.high:.10g}"
    return " ".join(part for part in (low, high) if part)


def arrows() -> dict[str, set[str]]:
    """Rooms that each room's files import, from the import statements themselves."""
    found: dict[str, set[str]] = {}
    # A room's command line stands above the rooms.
    for path in sorted(path for path in PACKAGE.rglob("*.py") if path.name != "__main__.py"):
        own = _room(".".join(path.relative_to(ROOT).with_suffix("").parts))
        if own is None:
            continue
        targets = found.setdefault(own, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            targets |= {room for name in names if (room := _room(name)) is not None}
        targets.discard(own)
    return found


def _room(module: str) -> str | None:
    parts = module.split(".")
    if parts[0] != PACKAGE.name or len(parts) < 2:
        return None
    for length in (3, 2):
        name = "/".join(parts[1:length])
        inner = PACKAGE / name
        if inner.is_dir() and len(parts) >= length and (length == 3) == (parts[1] == "table_tennis"):
            return name
    return None


def floors(found: dict[str, set[str]]) -> dict[str, int]:
    """Longest way down from each room to the ground."""
    height: dict[str, int] = {}

    def climb(room: str, above: tuple[str, ...] = ()) -> int:
        if room in above:
            raise ValueError(f"rooms import each other: {' → '.join((*above, room))}")
        if room not in height:
            height[room] = 1 + max((climb(below, (*above, room)) for below in found[room]), default=-1)
        return height[room]

    for room in found:
        climb(room)
    return height


def picture() -> str:
    """SVG of the rooms on their floors; an arrow for each import that no longer way down implies."""
    found = arrows()
    height = floors(found)
    places = {}
    for floor in range(max(height.values()) + 1):
        for column, room in enumerate(sorted(name for name in height if height[name] == floor)):
            places[room] = (MARGIN + column * (WIDTH + 40), MARGIN + (max(height.values()) - floor) * ROW)
    width = max(x for x, _ in places.values()) + WIDTH + MARGIN
    tall = max(y for _, y in places.values()) + HEIGHT + MARGIN
    reach: dict[str, set[str]] = {}
    for room in sorted(found, key=height.__getitem__):
        reach[room] = found[room].union(*(reach[below] for below in found[room]))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {tall}" font-family="sans-serif">'
    ]
    parts.append(f'<rect width="{width}" height="{tall}" fill="white"/>')
    for room, (x, y) in places.items():
        for below in sorted(found[room]):
            if any(below in reach[other] for other in found[room] - {below}):
                continue
            to_x, to_y = places[below]
            parts.append(
                f'<line x1="{x + WIDTH / 2}" y1="{y + HEIGHT}" '
                f'x2="{to_x + WIDTH / 2}" y2="{to_y}" stroke="#888"/>'
            )
    for room, (x, y) in places.items():
        parts.append(
            f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="4" fill="#e8f0f8" stroke="#357"/>'
            f'<text x="{x + WIDTH / 2}" y="{y + 23}" text-anchor="middle" font-size="14">{room}</text>'
        )
    return "\n".join([*parts, "</svg>"]) + "\n"


def main() -> None:
    """Write all files."""
    TARGET.mkdir(exist_ok=True)
    texts = {
        "topics.md": topics(),
        "services.md": services(),
        "parameters.md": parameters(),
        "rooms.svg": picture(),
    }
    for name, text in texts.items():
        path = TARGET / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
