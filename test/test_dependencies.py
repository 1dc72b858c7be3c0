"""What is imported is declared: in the base installation, or in the extras that a room may count on."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path
from xml.etree import ElementTree

import pytest
from packaging.version import Version

from processes import CHECKOUT, PACKAGE

EXTRAS: dict[str, set[str]] = {
    "core": set(),
    "core/compiled.py": {"sim"},
    "cluster": {"ray"},
    "contract": set(),
    "bags": set(),
    "learning": {"examples", "lerobot", "minari"},
    "robots": {"sim"},
    "table_tennis": {"sim"},
    "recordings": {"lerobot", "minari"},
    "reports": {"sim"},
    "nodes": {"ros", "sim"},
    "rally": {"sim"},
    "explain": {"sim"},
    "studio": {"ros", "sim", "studio"},
    "stack": {"ros", "sim"},
    "demo": {"ros", "sim"},
    "up": {"ros", "sim"},
    "studies": {"studies"},
}
"""Extras beside the base installation, by room, and by file where one has more than its room."""

BASE_ROOMS = ("core", "cluster", "contract", "bags", "learning", "recordings")
NONE_OLDER = {"box2d", "colcon-common-extensions", "ros-jazzy-common-interfaces", "ros-jazzy-rclpy"}
"""Distributions of which the lock's version is the oldest with a wheel."""
ELSEWHERE = {
    "benchmarks": {"imitation", "sb3_contrib", "stable_baselines3"},
    "test": {"lerobot"},
}
"""What one benchmark compares with, and one test holds our files against, in environments of their own."""

MODULES = {"torch.utils.tensorboard": "tensorboard"}
"""Modules that another distribution than their own has to be there for."""


installed = cache(packages_distributions)
"""Distributions by the modules that they bring; slow to ask for."""


def normal(name: str) -> str:
    """A distribution's name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.fixture(scope="module")
def declared(source: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """Names of the distributions that each extra asks for, and those of the base as extra ''."""
    target = tmp_path_factory.mktemp("metadata")
    subprocess.run(
        [sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", str(target)],
        env={**os.environ, "ROS_DISTRO": ""},
        cwd=source,
        check=True,
    )
    found: dict[str, set[str]] = {"": set()}
    extra = ""
    for line in (target / f"{PACKAGE}.egg-info" / "requires.txt").read_text(encoding="utf-8").splitlines():
        if section := re.fullmatch(r"\[(.+)\]", line):
            extra = section[1]
            found[extra] = set()
        elif line:
            found[extra].add(normal(re.split(r"[\[<>=!~; ]", line)[0]))
    return found


@pytest.fixture(scope="module")
def ros() -> set[str]:
    """Modules that a ROS installation has, as package.xml names them."""
    manifest = ElementTree.parse(CHECKOUT / "package.xml").getroot()
    named = {str(element.text) for element in manifest.iter("exec_depend")}
    return {name for name in named if not name.startswith("python3-")}


def files(place: Path) -> list[Path]:
    """A file, or those below a folder but such as have extras of their own."""
    apart = {CHECKOUT / PACKAGE / name for name in EXTRAS if name.endswith(".py")}
    return [place] if place.is_file() else sorted(set(place.rglob("*.py")) - apart)


def imported(place: Path) -> Iterator[tuple[str, str]]:
    """What a file, or those below a folder, import from others' packages, and where."""
    own = {path.stem for path in (CHECKOUT / "test" / "helpers").glob("*.py")}
    own |= {path.stem for path in (CHECKOUT / "benchmarks").iterdir()} | {PACKAGE, "setup"}
    for path in files(place):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: list[str] = []
            line = 0
            if isinstance(node, ast.Import):
                names, line = [alias.name for alias in node.names], node.lineno
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names, line = [node.module], node.lineno
            for name in names:
                top = name.partition(".")[0]
                if top not in own and top not in sys.stdlib_module_names:
                    yield name, f"{path.relative_to(CHECKOUT)}:{line}"


@cache
def distributions(module: str) -> set[str]:
    """The distributions that bring a module."""
    if module in MODULES:
        return {MODULES[module]}
    top = module.partition(".")[0]
    return {normal(name) for name in installed().get(top, [top])}


def undeclared(place: Path, allowed: set[str], ros: set[str], with_ros: bool) -> list[str]:
    """Imports of a file, or below a folder, that no allowed distribution brings."""
    found = []
    for module, where in imported(place):
        of_ros = module.partition(".")[0] in ros
        known = with_ros if of_ros else bool(distributions(module) & allowed)
        if not known:
            found.append(f"{where}: {module}")
    return found


@pytest.mark.parametrize("room", EXTRAS)
def test_a_room_imports_what_its_extras_bring(
    room: str, declared: dict[str, set[str]], ros: set[str]
) -> None:
    allowed = declared[""].union(*(declared[extra] for extra in EXTRAS[room]))
    found = undeclared(CHECKOUT / PACKAGE / room, allowed, ros, "ros" in EXTRAS[room])
    assert not found, "\n".join(found)


def test_every_room_is_listed() -> None:
    rooms = {path.parent.name for path in (CHECKOUT / PACKAGE).glob("*/__init__.py")}
    assert rooms == {name for name in EXTRAS if not name.endswith(".py")}


@pytest.mark.parametrize("folder", ["test", "benchmarks", "scripts"])
def test_tests_and_benchmarks_import_what_make_venv_installs(
    folder: str, declared: dict[str, set[str]], ros: set[str]
) -> None:
    allowed = set().union(*declared.values(), ELSEWHERE.get(folder, set()))
    found = undeclared(CHECKOUT / folder, {normal(name) for name in allowed}, ros, True)
    assert not found, "\n".join(found)


def test_nothing_is_declared_in_vain(declared: dict[str, set[str]]) -> None:
    places = [CHECKOUT / PACKAGE, *(CHECKOUT / PACKAGE / name for name in EXTRAS if name.endswith(".py"))]
    used = {name for place in places for module, _ in imported(place) for name in distributions(module)}
    asked = declared[""].union(*(declared[extra] for extra in ("sim", "studies", "minari", "lerobot", "ray")))
    # Gymnasium's own worlds are in "studies" as well; it is Gymnasium that imports what they stand on.
    assert asked - used - declared["examples"] == set()


def pins(name: str) -> dict[str, Version]:
    """Exact versions of a constraints file."""
    lines = (CHECKOUT / name).read_text(encoding="utf-8").splitlines()
    pinned = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {normal(distribution): Version(version) for distribution, version in pinned}


def floors() -> dict[str, Version]:
    """The lower bounds of setup.py."""
    text = (CHECKOUT / "setup.py").read_text(encoding="utf-8")
    stated = re.findall(r'"([\w-]+)(?:\[\w+\])?>=([\d.]+)', text)
    return {normal(name): Version(version) for name, version in stated}


def test_make_test_lowest_installs_the_floors_torch_apart() -> None:
    lowest, lock, lower_bounds = pins("constraints-lowest.txt"), pins("constraints.txt"), floors()
    assert lowest.pop("torch") == lock["torch"] > lower_bounds.pop("torch")
    assert lowest == lower_bounds
    assert {name for name, version in lowest.items() if version >= lock[name]} == NONE_OLDER


def test_library_and_bags_load_without_any_extra(declared: dict[str, set[str]], ros: set[str]) -> None:
    extras = set().union(*(names for extra, names in declared.items() if extra)) - declared[""]
    refused = {top for top, names in installed().items() if {normal(n) for n in names} <= extras}
    modules = [
        ".".join(path.relative_to(CHECKOUT).with_suffix("").parts).removesuffix(".__init__")
        for room in BASE_ROOMS
        for path in files(CHECKOUT / PACKAGE / room)
    ]
    code = f"""
import importlib, sys
class Refuse:
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in {refused | ros!r}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Refuse)
for module in {modules!r}:
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        print(module, "needs", error)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    assert modules
    assert done.stdout == ""
