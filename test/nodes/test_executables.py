"""Every executable starts and stops, found as `ros2 run` finds it, and takes its file in config/ whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from domains import observer, reserved_domain
from msrd_ros.__main__ import COMMANDS, EXECUTABLES, USER_ERROR, main
from processes import CHECKOUT, PACKAGE, START_TIMEOUT_S, Installation, Launcher, RunningProcess

ROOMS = ("msrd_ros.nodes.", "msrd_ros.studio.")
NODES = [name for name, command in EXECUTABLES.items() if command.module.startswith(ROOMS)]
SLOW = ["simulator", "demonstrator"]
"""In a fresh installation these compile for half a minute; they are asked last."""
TOOLS = [name for name in EXECUTABLES if name not in NODES]
ANSWER_TIMEOUT_S = 120.0
"""A simulator answers once it has compiled, which takes a fresh installation up to a minute."""

INSTEAD_OF_DEFAULTS: dict[str, dict[str, object]] = {"trainer": {"source": "played"}}
"""A trainer ends the iteration under way first, and a fresh installation compiles for half a minute in it."""

pytestmark = pytest.mark.processes


class InstalledNode(NamedTuple):
    """A node of an installation with its parameter file, alone on its domain."""

    process: RunningProcess
    parameter_file: Path
    domain_id: int


@pytest.fixture(scope="module", params=["pip_installation", "colcon_overlay"])
def installation(request: pytest.FixtureRequest) -> Installation:
    """The package as users install it, in two ways."""
    found: Installation = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="module")
def installed_nodes(
    installation: Installation, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, InstalledNode]]:
    """All nodes, started from where no checkout is in sight; at once, as some take their time."""
    nodes = {}
    with ExitStack() as stack:
        for name in NODES:
            domain_id = stack.enter_context(reserved_domain())
            launcher = Launcher(installation, domain_id, tmp_path_factory.mktemp(name))
            stack.callback(launcher.close)
            file = installation.share() / "config" / f"{name}.yaml"
            changed = INSTEAD_OF_DEFAULTS.get(name, {})
            process = launcher.start(name, "--ros-args", "--params-file", str(file), parameters=changed)
            nodes[name] = InstalledNode(process, file, domain_id)
        yield nodes


@pytest.mark.parametrize("name", sorted(NODES, key=SLOW.__contains__))
def test_node_starts_with_its_parameter_file_and_stops(
    installation: Installation, installed_nodes: dict[str, InstalledNode], name: str
) -> None:
    process, file, domain_id = installed_nodes[name]
    wanted = _parameters(file, name) | INSTEAD_OF_DEFAULTS.get(name, {})
    with observer(domain_id) as node:
        request = ListParameters.Request()
        declared = _ask(node, process, ListParameters, f"/{name}/list_parameters", request)
        assert set(wanted) <= set(declared.result.names), f"{file.name} has what {name} does not declare"
        request = GetParameters.Request(names=list(wanted))
        values = _ask(node, process, GetParameters, f"/{name}/get_parameters", request).values
    assert {key: _plain(value) for key, value in zip(wanted, values, strict=True)} == wanted

    code = process.stop(signal.SIGINT if installation.name == "colcon overlay" else signal.SIGTERM)
    assert code == 0, process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize("name", TOOLS)
def test_tool_starts_and_stops(installation: Installation, domain_id: int, tmp_path: Path, name: str) -> None:
    process = Launcher(installation, domain_id, tmp_path).start(name, "--help")
    assert process.wait(START_TIMEOUT_S) == 0, process.output
    assert "usage:" in process.output


@pytest.mark.parametrize("name", EXECUTABLES)
def test_command_line_is_checked(launcher: Launcher, name: str) -> None:
    wrong = "--no-such-option" if name in NODES else "no_such_study"
    process = launcher.start(name, wrong)
    assert process.wait(START_TIMEOUT_S) == USER_ERROR, process.output
    assert wrong in process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize("name", NODES)
def test_unknown_parameter_is_refused_by_name(launcher: Launcher, name: str) -> None:
    process = launcher.start(name, parameters={"no_such_parameter": 1})
    assert process.wait(START_TIMEOUT_S) == USER_ERROR, process.output
    assert "no_such_parameter" in process.output
    assert "Traceback" not in process.output


def test_unknown_name_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["umpire"]) == USER_ERROR
    error = capsys.readouterr().err.splitlines()
    assert "'umpire'" in error[0]
    assert [line.split()[0] for line in error[1:]] == list(COMMANDS)


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_without_a_name_the_known_are_listed(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed[1:]] == list(COMMANDS)


def test_only_what_is_asked_for_is_imported() -> None:
    code = (
        "import sys; from msrd_ros.__main__ import main; main(['--help']); "
        "print('heavy:', sorted({'torch', 'rclpy', 'pybullet', 'numba'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "heavy: []"


def test_missing_dependency_is_named(tmp_path: Path) -> None:
    # -I -S: a Python without site-packages, as where only the checkout is there.
    code = f"import sys; sys.path.insert(0, {str(CHECKOUT)!r}); from {PACKAGE}.__main__ import main; "
    code += "sys.exit(main(['simulator']))"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == USER_ERROR, done.stderr
    assert done.stderr.startswith("simulator: error: the Python package '")
    assert len(done.stderr.splitlines()) == 1


def test_home_is_not_needed(launcher: Launcher, ros_node: Node, tmp_path: Path) -> None:
    launcher.set("HOME", "/nowhere")
    launcher.set("TMPDIR", str(tmp_path))
    for variable in ("ROS_LOG_DIR", "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "XDG_CACHE_HOME"):
        launcher.unset(variable)
    process = launcher.start("executor")
    _ask(ros_node, process, ListParameters, "/executor/list_parameters", ListParameters.Request())
    assert process.stop() == 0, process.output
    assert (tmp_path / f"msrd_ros-{os.getuid()}" / "ros_log").is_dir()


def _ask(node: Node, process: RunningProcess, service: Any, topic: str, request: Any) -> Any:
    """Call a service of a process that is starting."""
    client = node.create_client(service, topic)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    while not client.wait_for_service(timeout_sec=0.25):
        process.require_running()
        assert time.monotonic() < deadline, f"{topic} did not appear\n{process.output}"
    future = client.call_async(request)
    executor.spin_until_future_complete(future, timeout_sec=ANSWER_TIMEOUT_S)
    executor.remove_node(node)
    node.destroy_client(client)
    assert future.done(), f"{topic} gave no answer\n{process.output}"
    return future.result()


def _parameters(file: Path, node: str) -> dict[str, Any]:
    """What a parameter file sets for a node."""
    sections = yaml.safe_load(file.read_text(encoding="utf-8"))
    assert set(sections) <= {node, f"/{node}", "/**"}, f"{file} is not for {node}"
    merged: dict[str, Any] = {}
    for section in sections.values():
        merged |= section["ros__parameters"]
    return merged


def _plain(value: Any) -> Any:
    plain = parameter_value_to_python(value)
    return plain if isinstance(plain, str | bool | int | float | None) else list(plain)
