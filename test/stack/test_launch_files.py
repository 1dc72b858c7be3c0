"""The launch files start what `up` starts: with stand-ins of launch always, with the real one where it is."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import launch_stand_in
from launch_stand_in import DeclareLaunchArgument, ExecutableInPackage, ExecuteProcess, Node, Shutdown
from msrd_ros.core.errors import UserError
from msrd_ros.stack.processes import ros_arguments
from msrd_ros.stack.sets import SETS, RosOptions
from processes import CHECKOUT, PACKAGE, RunningProcess
from stack import Stack

FILE = str(Path(__file__))
BRIDGE = "msrd_ros.stack.launch_files"
IS_REAL_LAUNCH_THERE = all(
    importlib.util.find_spec(name) is not None for name in ("launch_ros", "ros2launch", "ros2cli")
)

SAID = [
    ("teach", {}),
    ("teach", {"bags": "some_bags", "namespace": "left", "robot": "ur10e", "log_level": "debug"}),
    ("play", {"balls": "0"}),
    ("play", {"checkpoint": FILE, "mode": "real_time", "params_file": FILE, "labels": "one,another"}),
    ("train", {"resume": "true", "out": "some/where", "iterations": "3"}),
]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The stand-ins, in place of whatever there is."""
    for name, module in launch_stand_in.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, BRIDGE, raising=False)
    yield
    sys.modules.pop(BRIDGE, None)


def launch_file(name: str) -> ModuleType:
    """The module that a launch file is."""
    path = CHECKOUT / "launch" / f"{name}.launch.py"
    spec = importlib.util.spec_from_file_location(f"{name}_launch", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def started(name: str, said: dict[str, str]) -> list[Any]:
    """What a launch file starts."""
    return launch_stand_in.entities(launch_file(name).generate_launch_description(), said)


def test_each_set_has_its_launch_file() -> None:
    files = {path.name.removesuffix(".launch.py") for path in (CHECKOUT / "launch").iterdir() if path.suffix}
    assert files == set(SETS)


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("name", SETS)
def test_arguments_are_those_of_the_set(name: str) -> None:
    description = launch_file(name).generate_launch_description()
    declared = [one for one in description.entities if isinstance(one, DeclareLaunchArgument)]
    for one, argument in zip(declared, SETS[name].arguments, strict=True):
        assert (one.name, one.default_value) == (argument.name, argument.default)
        assert one.description
        assert set(one.choices or []) - {""} == set(argument.choices)


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize(("name", "said"), SAID)
def test_the_same_nodes_start_with_the_same_words(name: str, said: dict[str, str]) -> None:
    values = SETS[name].read(said)
    (stage,) = SETS[name].stages(values)
    options = RosOptions.of(values)
    nodes: list[Node] = started(name, said)
    for node, call in zip(nodes, stage.nodes, strict=True):
        assert (node.package, node.executable, node.name) == (PACKAGE, call.executable, call.executable)
        assert node.output == "screen"
        # What launch makes of its parts, beside what `up` says.
        words = ["-r", f"__ns:={node.namespace}"] if node.namespace else []
        for source, target in node.remappings:
            words += ["-r", f"{source}:={target}"]
        words += node.ros_arguments
        files = [one for one in node.parameters if isinstance(one, str)]
        parameters: dict[str, Any] = {}
        for one in node.parameters[len(files) :]:
            parameters |= one
        for file in files:
            words += ["--params-file", file]
        assert ros_arguments(parameters, words) == ros_arguments(
            call.parameters, options.words(call.executable)
        )


@pytest.mark.usefixtures("stand_in")
def test_the_demo_is_one_process_that_starts_the_others() -> None:
    (process,) = started("demo", {"out": "here", "balls": "3"})
    assert isinstance(process, ExecuteProcess)
    executable, *words = process.cmd
    assert executable == ExecutableInPackage("up", PACKAGE)
    assert words[0] == "demo"
    assert {"out:=here", "balls:=3", "seed:=0"} <= set(words)


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize(
    ("executable", "respawn", "status", "ends"),
    [
        ("evaluator", "false", 0, True),
        ("evaluator", "true", 0, True),
        ("evaluator", "true", -9, False),
        ("simulator", "false", -9, True),
        ("simulator", "false", 0, True),
        ("simulator", "true", 1, False),
    ],
)
def test_a_node_that_ends_takes_all_along_or_comes_again(
    executable: str, respawn: str, status: int, ends: bool
) -> None:
    nodes = {node.executable: node for node in started("play", {"checkpoint": FILE, "respawn": respawn})}
    node = nodes[executable]
    assert node.respawn == (respawn == "true")
    actions = node.on_exit(SimpleNamespace(returncode=status), launch_stand_in.Context())
    assert [type(action) for action in actions] == ([Shutdown] if ends else [])


@pytest.mark.usefixtures("stand_in")
def test_what_is_not_allowed_is_refused() -> None:
    with pytest.raises(UserError, match="give letters, digits"):
        started("play", {"balls": "0", "namespace": "my stack"})


@pytest.mark.processes
@pytest.mark.skipif(
    not IS_REAL_LAUNCH_THERE, reason="launch and launch_ros come with a ROS installation only"
)
def test_the_real_launch_starts_and_ends_it(stack: Stack, colcon_overlay: Any, tmp_path: Path) -> None:
    ros2 = shutil.which("ros2")
    assert ros2 is not None
    process = RunningProcess(
        "ros2 launch",
        [ros2, "launch", PACKAGE, "play.launch.py", "balls:=0", "namespace:=/left"],
        {**colcon_overlay.environment(), "ROS_DOMAIN_ID": os.environ["ROS_DOMAIN_ID"]},
        tmp_path,
    )
    stack.wait_until(lambda: stack.node.count_publishers("/left/clock"), "the simulator", 120.0, process)
    process.send_signal(signal.SIGINT)
    process.wait(60.0)
    assert "Traceback" not in process.output
