"""Rooms: imports run downwards only, and each room does without what is not its own.

Every import counts, also those inside functions and under TYPE_CHECKING.
"""

from __future__ import annotations

import ast
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from processes import CHECKOUT, PACKAGE

ROOT = CHECKOUT / PACKAGE

ROS = {
    "action_msgs",
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "launch",
    "launch_ros",
    "lifecycle_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "tf2_msgs",
    "tf2_ros",
    "trajectory_msgs",
    "visualization_msgs",
}
BULLET = {"pybullet", "pybullet_data", "pybullet_utils"}
TORCH = {"torch", "tensorboard", "functorch"}
BAGS = {"rosbags", "mcap", "mcap_ros2"}
DRAWING = {"matplotlib"}


class Room(NamedTuple):
    """What a part of the package may import: other parts of it, and none of some other packages."""

    below: set[str]
    forbidden: set[str]


_GROUND = ROS | BULLET | TORCH | BAGS | DRAWING

ROOMS = {
    "core": Room(set(), _GROUND),
    "cluster": Room({"core"}, _GROUND),
    "robots": Room({"core"}, _GROUND),
    "contract": Room({"core", "robots"}, _GROUND),
    "bags": Room({"core", "robots", "contract"}, ROS | BULLET | TORCH | DRAWING),
    "learning": Room({"core"}, ROS | BULLET | BAGS | DRAWING),
    "table_tennis/strategies": Room({"core", "contract"}, _GROUND),
    "table_tennis/ball": Room({"core", "contract", "table_tennis/strategies"}, _GROUND),
    "table_tennis/arm": Room(
        {"core", "robots", "contract", "table_tennis/strategies", "table_tennis/ball"}, _GROUND
    ),
}
ROOMS["table_tennis/simulation"] = Room(
    {*ROOMS["table_tennis/arm"].below, "table_tennis/arm"}, ROS | TORCH | BAGS | DRAWING
)
ROOMS["table_tennis/teachers"] = Room(
    {*ROOMS["table_tennis/simulation"].below, "table_tennis/simulation"}, ROS | TORCH | BAGS | DRAWING
)
_TABLE = {*ROOMS["table_tennis/teachers"].below, "table_tennis/teachers"}
ROOMS["table_tennis/strokes"] = Room({*_TABLE, "learning", "bags", "cluster"}, ROS | DRAWING)
_ALL_BELOW = {*ROOMS["table_tennis/strokes"].below, "table_tennis/strokes"}
ROOMS["recordings"] = Room(_ALL_BELOW, ROS | DRAWING)
ROOMS["reports"] = Room(_ALL_BELOW, ROS | BAGS)
ROOMS["rally"] = Room({*_ALL_BELOW, "reports"}, ROS | BAGS)
ROOMS["explain"] = Room({*_ALL_BELOW, "recordings", "reports"}, ROS)
ROOMS["nodes"] = Room({*_ALL_BELOW, "recordings"}, DRAWING)
ROOMS["stack"] = Room({*ROOMS["nodes"].below, "nodes"}, DRAWING)
ROOMS["studio"] = Room({*ROOMS["stack"].below, "stack", "explain", "reports"}, BULLET | DRAWING)
ROOMS["demo"] = Room({*_ALL_BELOW, "recordings", "reports", "stack"}, set())
ROOMS["up"] = Room({"core", "robots", "stack", "demo"}, DRAWING)
ROOMS["studies"] = Room({*_ALL_BELOW, "recordings", "reports", "stack"}, set())
"""From the ground up. Imports run downwards only."""


class Import(NamedTuple):
    """One import statement's target and where it stands."""

    module: str
    where: str


def imports(path: Path) -> Iterator[Import]:
    """Every module that a file imports, relative imports and `import_module` with a literal included."""
    tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
    package = path.relative_to(CHECKOUT).with_suffix("").parts[:-1]
    for node in ast.walk(tree):
        where = f"{path.relative_to(CHECKOUT)}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, where) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = list(package[: len(package) - node.level + 1]) if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            # `from msrd_ros import learning` names the part only in the alias.
            yield from (Import(f"{module}.{alias.name}", where) for alias in node.names)
        elif isinstance(node, ast.Call) and _called(node) in ("import_module", "__import__"):
            literals = [argument.value for argument in node.args[:1] if isinstance(argument, ast.Constant)]
            yield from (Import(str(name), where) for name in literals)


def _called(node: ast.Call) -> str:
    function = node.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def room_of(module: str) -> str | None:
    """The room of a module of the package, the innermost one that is listed."""
    parts = module.split(".")[1:]
    for length in (2, 1):
        name = "/".join(parts[:length])
        if name in ROOMS:
            return name
    return None


def violations(name: str, path: Path) -> list[str]:
    """What a file of a room imports against the plan."""
    room = ROOMS[name]
    found = []
    for module, where in imports(path):
        top, _, rest = module.partition(".")
        inner = room_of(module) if top == PACKAGE else None
        if top in room.forbidden:
            found.append(f"{where}: {name} must do without {top}")
        if inner is not None and inner != name and inner not in room.below:
            found.append(f"{where}: {name} must not know {inner}")
        if rest.partition(".")[0] == "__main__" and top == PACKAGE:
            found.append(f"{where}: {name} must not know the command line")
    return found


def test_every_module_has_its_room() -> None:
    for path in ROOT.rglob("*.py"):
        module = ".".join(path.relative_to(CHECKOUT).with_suffix("").parts)
        assert path.name in ("__init__.py", "__main__.py") or room_of(module), f"{path} has no room"


@pytest.mark.parametrize("name", ROOMS)
def test_imports_run_downwards_only(name: str) -> None:
    # A room's command line stands above all rooms, as the package's does; nobody imports it.
    files = [path for path in sorted((ROOT / name).rglob("*.py")) if path.name != "__main__.py"]
    found = [line for path in files for line in violations(name, path)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("name", "code", "blame"),
    [
        ("learning", "def f():\n    import rclpy.node\n", "rclpy"),
        ("learning", "from msrd_ros.table_tennis import ball\n", "table_tennis"),
        ("table_tennis/ball", "from msrd_ros.table_tennis.arm import driver\n", "table_tennis/arm"),
        ("bags", "from ..nodes import recorder\n", "nodes"),
        ("core", "import importlib\nimportlib.import_module('msrd_ros.bags.reader')\n", "bags"),
        ("table_tennis/teachers", "if TYPE_CHECKING:\n    from torch import Tensor\n", "torch"),
        ("studies", "import msrd_ros.nodes.trainer\n", "nodes"),
        ("nodes", "from msrd_ros.__main__ import main\n", "command line"),
    ],
)
def test_a_wrong_import_is_seen(
    name: str, code: str, blame: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.CHECKOUT", tmp_path)
    path = tmp_path / PACKAGE / name / "wrong.py"
    path.parent.mkdir(parents=True)
    path.write_text(code, encoding="utf-8")
    assert [line for line in violations(name, path) if blame in line]


TASK = ("table_tennis", "studies", "demo")
"""Where sides and strokes have names; everywhere else a strategy is data."""

_NAMES = re.compile(r"forehand|backhand|topspin", re.IGNORECASE)
_WORDS = re.compile(r"\b(push|slice)\b", re.IGNORECASE)


def named_strokes(path: Path) -> list[str]:
    """Lines of a file that name a side or a stroke; Python's own `slice` outside texts does not count."""
    found = []
    with path.open("rb") as stream:
        for token in tokenize.tokenize(stream.readline):
            said = token.type not in (tokenize.NAME, tokenize.ENCODING) and _WORDS.search(token.string)
            if said or _NAMES.search(token.string):
                found.append(f"{path}:{token.start[0]}: {token.line.strip()}")
    return found


def test_nothing_outside_the_task_names_a_side_or_a_stroke() -> None:
    files = [path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[0] not in TASK]
    assert files
    found = [line for path in files for line in named_strokes(path)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("code", "lines"),
    [
        ("side = Side.FOREHAND\n", 1),
        ("label = 'my push'\n", 1),
        ("x = 1  # like a slice\n", 1),
        ("part = slice(0, 3)\n", 0),
    ],
)
def test_a_named_stroke_is_seen(code: str, lines: int, tmp_path: Path) -> None:
    path = tmp_path / "some.py"
    path.write_text(code, encoding="utf-8")
    assert len(named_strokes(path)) == lines
