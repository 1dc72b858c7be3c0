"""Fixtures of all tests: a ROS domain for each test, and the package installed as users install it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from rclpy.node import Node

from builds import colcon
from domains import observer, reserved_domain
from msrd_ros.core.compiled_cache import choose_compiled_cache
from msrd_ros.core.scratch import provide_writable_directories
from processes import CHECKOUT, PACKAGE, Installation, Launcher
from stack import Stack

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["RCUTILS_COLORIZED_OUTPUT"] = "0"
# Threads that share out tensors this small wait for each other: ten times slower where other work has a core.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# The same examples in every run; whoever looks for new ones says --hypothesis-profile=default.
settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")
provide_writable_directories(os.environ)
choose_compiled_cache(os.environ)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Where tests run side by side, a file's go one after the other, and so do all that start processes.

    First of all, as pytest-xdist reads the marks in the same hook.
    """
    for item in items:
        file = item.path.relative_to(CHECKOUT).as_posix()
        group = "processes" if item.get_closest_marker("processes") else file
        item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture(scope="session", autouse=True)
def ros_log_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keep ROS logs of this session and of its processes out of the home directory."""
    directory = tmp_path_factory.mktemp("ros_log")
    os.environ["ROS_LOG_DIR"] = str(directory)
    return directory


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain that nobody else on this machine tests on, set for this process and its children."""
    with reserved_domain() as chosen:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(chosen))
        yield chosen


@pytest.fixture
def ros_node(domain_id: int) -> Iterator[Node]:
    """A node of the test's own on its domain, in a context of its own."""
    with observer(domain_id) as node:
        yield node


@pytest.fixture
def launcher(domain_id: int, tmp_path: Path) -> Iterator[Launcher]:
    """Starts executables of the checkout on the test's domain."""
    started = Launcher(Installation("checkout", checkout=True), domain_id, tmp_path)
    yield started
    started.close()


@pytest.fixture
def stack(domain_id: int, tmp_path: Path) -> Iterator[Stack]:
    """Processes and a node of the test's own on its domain."""
    with Stack(domain_id, tmp_path) as one:
        yield one


@pytest.fixture(scope="module")
def shared_stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """The same for all tests of a module, on a domain that no other test takes meanwhile."""
    with reserved_domain() as chosen, Stack(chosen, tmp_path_factory.mktemp("stack")) as one:
        yield one


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout, so that building leaves nothing in it."""
    target = tmp_path_factory.mktemp("workspace") / "src" / PACKAGE
    shutil.copytree(CHECKOUT, target, ignore=_ignore)
    return target


def _ignore(directory: str, names: list[str]) -> set[str]:
    leave = {"build", "install", "log", "out", "runs", "__pycache__"}
    return {
        name
        for name in names
        if name in leave
        or name.startswith(".")
        or name.endswith(".egg-info")
        or Path(directory, name, "pyvenv.cfg").exists()
    }


@pytest.fixture(scope="session")
def pip_installation(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """`pip install .` in a fresh virtual environment that sees this one's other packages."""
    prefix = tmp_path_factory.mktemp("pip_environment")
    venv.create(prefix, with_pip=False, symlinks=True)
    python = prefix / "bin" / "python"
    libraries = Path(_ask(python, "import sysconfig; print(sysconfig.get_path('purelib'))"))
    ours = [path for path in sys.path if path.endswith("-packages")]
    # addsitedir, and not a plain line: the wheels of rclpy find their libraries through a .pth file.
    lines = [f"import site; site.addsitedir({path!r})\n" for path in ours]
    (libraries / "dependencies.pth").write_text("".join(lines), encoding="utf-8")
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed"]
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", *options]
    _run([*pip, str(source)], source)
    # The checkout must not be what is tested.
    return Installation("pip environment", {"AMENT_PREFIX_PATH": str(prefix), "PYTHONPATH": ""})


@pytest.fixture(scope="session")
def colcon_overlay(source: Path) -> Installation:
    """`colcon build` in a fresh workspace, and what sourcing its install/setup.bash sets."""
    workspace = source.parent.parent
    _run([*colcon(workspace), "build", "--event-handlers", "console_direct+"], workspace)
    shell = "source install/setup.bash && env -0"
    clean = {
        key: value for key, value in os.environ.items() if key not in ("AMENT_PREFIX_PATH", "PYTHONPATH")
    }
    printed = subprocess.run(
        ["bash", "-c", shell], cwd=workspace, env=clean, capture_output=True, text=True, check=True
    ).stdout
    variables = dict(entry.split("=", 1) for entry in printed.split("\0") if "=" in entry)
    return Installation(
        "colcon overlay", {key: variables[key] for key in ("AMENT_PREFIX_PATH", "PYTHONPATH", "PATH")}
    )


def _run(command: list[str], directory: Path) -> str:
    done = subprocess.run(
        command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(command)} ended with {done.returncode}\n{done.stdout[-4000:]}"
    return done.stdout


def _ask(python: Path, code: str) -> str:
    return subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
