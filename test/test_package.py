"""The package as ROS 2 and pip see it: kind, marker, manifest, files, launch files, parameter files."""

from __future__ import annotations

import ast
import dataclasses
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import msrd_ros
from builds import colcon
from msrd_ros.__main__ import EXECUTABLES
from msrd_ros.nodes.parameter_files import NODES, config_type, parameter_file
from processes import CHECKOUT, PACKAGE, Installation

pytestmark = pytest.mark.slow

SHARED_FOLDERS = ("config", "launch", "bags")


@pytest.fixture(params=["pip_installation", "colcon_overlay"])
def installation(request: pytest.FixtureRequest) -> Installation:
    found: Installation = request.getfixturevalue(request.param)
    return found


def files_below(directory: Path) -> dict[str, bytes]:
    """Relative path and content of every file below a directory."""
    return {
        path.relative_to(directory).as_posix(): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts and path.name != "COLCON_IGNORE"
    }


def test_colcon_sees_an_ament_python_package(source: Path) -> None:
    # A manifest that does not parse silently makes it plain Python, and `ros2 run` finds nothing.
    workspace = source.parent.parent
    listed = subprocess.run(
        [*colcon(workspace), "list"], cwd=workspace, capture_output=True, text=True, check=True
    ).stdout
    assert listed.split() == [PACKAGE, f"src/{PACKAGE}", "(ros.ament_python)"]


def test_executables_are_where_ros2_run_looks(installation: Installation) -> None:
    for name in EXECUTABLES:
        path = installation.executable(name)
        assert path == installation.prefix() / "lib" / PACKAGE / name
        assert path.read_text(encoding="utf-8").startswith("#!/usr/bin/env python3\n")


def test_share_directory_is_complete(installation: Installation, source: Path) -> None:
    share = installation.share()
    assert (share / "package.xml").read_bytes() == (source / "package.xml").read_bytes()
    for folder in SHARED_FOLDERS:
        assert files_below(share / folder) == files_below(source / folder), folder


def test_installed_code_is_the_sources_code(installation: Installation, source: Path, tmp_path: Path) -> None:
    python = installation.prefix() / "bin" / "python"
    code = "import msrd_ros, sys; print(msrd_ros.__path__[0])"
    found = subprocess.run(
        [python if python.exists() else sys.executable, "-c", code],
        env=installation.environment(),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    assert Path(found).is_relative_to(installation.prefix())
    assert files_below(Path(found)) == files_below(source / PACKAGE)


def test_one_version_everywhere() -> None:
    manifest = ElementTree.parse(CHECKOUT / "package.xml").getroot()
    assert manifest.findtext("version") == msrd_ros.__version__
    changelog = (CHECKOUT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d+\.\d+\.\d+)\]", changelog, re.MULTILINE)
    assert released[0] == msrd_ros.__version__


def test_manifest_names_every_ros_package_that_is_imported() -> None:
    manifest = ElementTree.parse(CHECKOUT / "package.xml").getroot()
    named = {element.text for element in manifest.iter("exec_depend")}
    imported = set()
    for path in (CHECKOUT / PACKAGE).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.partition(".")[0])
            elif isinstance(node, ast.Import):
                imported.update(alias.name.partition(".")[0] for alias in node.names)
    interfaces = ("_msgs", "_interfaces", "_srvs")
    ros = {name for name in imported if name.endswith(interfaces) or name in ("rclpy", "tf2_ros")}
    assert ros <= named


def test_every_node_has_a_parameter_file_and_every_file_a_node() -> None:
    rooms = ("msrd_ros.nodes.", "msrd_ros.studio.")
    nodes = {name for name, command in EXECUTABLES.items() if command.module.startswith(rooms)}
    assert set(NODES) == nodes
    assert {path.stem for path in (CHECKOUT / "config").glob("*.yaml")} == {*nodes, "strategies"}


@pytest.mark.parametrize("node", NODES)
def test_parameter_file_repeats_what_the_node_declares(node: str) -> None:
    text = (CHECKOUT / "config" / f"{node}.yaml").read_text(encoding="utf-8")
    assert text == parameter_file(node), "run `make format`"
    content = yaml.safe_load(text)["/**"]["ros__parameters"]
    defaults = {key: value for key, value in dataclasses.asdict(config_type(node)()).items() if value != []}
    assert content == defaults


@pytest.mark.parametrize(("distribution", "with_wheels"), [("", True), ("jazzy", False)])
def test_rclpy_comes_from_wheels_only_without_a_ros_installation(
    distribution: str, with_wheels: bool, source: Path, tmp_path: Path
) -> None:
    subprocess.run(
        [sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", str(tmp_path)],
        env={**os.environ, "ROS_DISTRO": distribution},
        cwd=source,
        check=True,
    )
    asked = (tmp_path / f"{PACKAGE}.egg-info" / "requires.txt").read_text(encoding="utf-8")
    assert ("ros-jazzy-rclpy" in asked) == with_wheels
    # The installation's messages are built against NumPy 1.
    assert ("numpy<2" in asked) != with_wheels


def test_constraints_pin_what_setup_asks_for() -> None:
    pinned = {}
    for line in (CHECKOUT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        text = line.partition("#")[0].partition(";")[0].strip()
        if text:
            name, equals, version = text.partition("==")
            assert equals, f"constraints.txt: {line!r} is no exact version"
            assert "://" not in version, f"constraints.txt: {line!r} names a place"
            pinned[name.strip().lower().replace("_", "-")] = version
    setup = ast.parse((CHECKOUT / "setup.py").read_text(encoding="utf-8"))
    texts = [node.value for node in ast.walk(setup) if isinstance(node, ast.Constant)]
    asked = [re.match(r"([A-Za-z][\w-]*)(\[\w+\])?([<>]=?)\d", str(text)) for text in texts]
    names = {match.group(1).lower().replace("_", "-") for match in asked if match}
    assert names, "setup.py asks for nothing"
    assert names - set(pinned) == set()


def test_importing_the_package_changes_nothing() -> None:
    code = "import os; before = dict(os.environ); import msrd_ros; print(dict(os.environ) == before)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "True"
