"""Three floors: imports run downwards only, and each wing does without what is not its own.

Every import counts, also those inside functions and under TYPE_CHECKING.
"""

from __future__ import annotations

import ast
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


class Floor(NamedTuple):
    """What a part of the package may import: other parts of it, and none of some other packages."""

    below: set[str]
    forbidden: set[str]


FLOORS = {
    "facts": Floor(set(), ROS | BULLET | TORCH | BAGS | DRAWING),
    "table_tennis": Floor({"facts"}, ROS | TORCH | BAGS | DRAWING),
    "learning": Floor({"facts"}, ROS | BULLET | BAGS | DRAWING),
    "bags": Floor({"facts"}, ROS | BULLET | TORCH | DRAWING),
    "experiments": Floor({"facts", "table_tennis", "learning", "bags"}, set()),
    "nodes": Floor({"facts", "table_tennis", "learning", "bags", "experiments"}, DRAWING),
}
"""Both on the top floor: nodes are shells, also around recipes; experiments start nodes as processes only."""


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


def violations(part: str, path: Path) -> list[str]:
    """What a file of a part imports against the plan."""
    floor = FLOORS[part]
    found = []
    for module, where in imports(path):
        top, _, rest = module.partition(".")
        inner = rest.partition(".")[0]
        if top in floor.forbidden:
            found.append(f"{where}: {part} must do without {top}")
        if top == PACKAGE and inner in FLOORS and inner != part and inner not in floor.below:
            found.append(f"{where}: {part} must not know {inner}")
        if top == PACKAGE and inner == "__main__":
            found.append(f"{where}: {part} must not know the command line")
    return found


def test_every_module_has_its_floor() -> None:
    folders = {path.relative_to(ROOT).parts[0] for path in ROOT.rglob("*.py") if path.parent != ROOT}
    assert folders == set(FLOORS)
    assert {path.name for path in ROOT.glob("*.py")} == {"__init__.py", "__main__.py"}


@pytest.mark.parametrize("part", FLOORS)
def test_imports_run_downwards_only(part: str) -> None:
    found = [line for path in sorted((ROOT / part).rglob("*.py")) for line in violations(part, path)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("part", "code", "blame"),
    [
        ("learning", "def f():\n    import rclpy.node\n", "rclpy"),
        ("learning", "from msrd_ros import table_tennis\n", "table_tennis"),
        ("bags", "from ..nodes import recorder\n", "nodes"),
        ("facts", "import importlib\nimportlib.import_module('msrd_ros.bags.reader')\n", "bags"),
        ("table_tennis", "if TYPE_CHECKING:\n    from torch import Tensor\n", "torch"),
        ("experiments", "import msrd_ros.nodes.trainer\n", "nodes"),
        ("nodes", "from msrd_ros.__main__ import main\n", "command line"),
    ],
)
def test_a_wrong_import_is_seen(
    part: str, code: str, blame: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.CHECKOUT", tmp_path)
    path = tmp_path / PACKAGE / part / "wrong.py"
    path.parent.mkdir(parents=True)
    path.write_text(code, encoding="utf-8")
    assert [line for line in violations(part, path) if blame in line]
