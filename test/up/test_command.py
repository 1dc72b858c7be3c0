"""`up`: what it takes, what it starts, and how all of it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from pathlib import Path

import pytest
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from made_up_policies import made_up_policies
from msrd_ros.__main__ import USER_ERROR, main
from msrd_ros.stack.sets import SETS
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from processes import RunningProcess
from stack import Stack

LABEL = ALL_LABELS[0]
END_S = 240.0


@pytest.mark.parametrize("name", SETS)
def test_arguments_are_listed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["up", name, "--help"]) == 0
    listed = re.findall(r"^  (\w+) ", capsys.readouterr().out, re.MULTILINE)
    assert listed == [argument.name for argument in SETS[name].arguments]


def test_sets_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["up", "--help"]) == 0
    listed = re.findall(r"^  (\w+) ", capsys.readouterr().out, re.MULTILINE)
    assert listed == list(SETS)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "everything",
            "there is no 'everything' to start; say one of teach, play, train, studio, rally, demo",
        ),
        ("play chekpoint:=x", "play has no argument 'chekpoint'; it takes checkpoint, robot, mode"),
        ("play mode:=fast", "play mode:=fast: give one of lockstep, real_time"),
        ("play --balls 3", "'--balls' is no argument; write name:=value"),
        ("play balls:=0 robot:=nobody", "robot 'nobody': is none of sawyer, ur10e"),
        ("train params_file:=nowhere.yaml", "train params_file:=nowhere.yaml: there is no such file"),
        ("demo mode:=real_time", "demo has no argument 'mode'"),
    ],
)
def test_a_wrong_call_is_refused_with_what_is_allowed(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["up", *words.split()]) == USER_ERROR
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("up: error: ")
    assert said in line


def test_the_demos_former_name_is_answered(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", "x"]) == USER_ERROR
    assert "demo is called `up demo` now" in capsys.readouterr().err


def started(stack: Stack, *words: str) -> RunningProcess:
    return stack.launcher.start("up", *words)


def children(process: RunningProcess) -> dict[str, int]:
    """Process numbers of the nodes that a process has started, by name (Linux)."""
    found = {}
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((path / "stat").read_text().rsplit(")", 1)[1].split()[1])
            words = (path / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if parent == process.pid and "msrd_ros" in words:
            found[words[words.index("msrd_ros") + 1]] = int(path.name)
    return found


def await_end(numbers: dict[str, int]) -> None:
    """Wait until processes are gone."""
    deadline = time.monotonic() + END_S
    while left := [name for name, number in numbers.items() if _runs(number)]:
        assert time.monotonic() < deadline, f"{', '.join(left)} still run"
        time.sleep(0.1)


def _runs(number: int) -> bool:
    try:
        return Path("/proc", str(number), "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_two_stacks_play_side_by_side_each_with_its_clock(stack: Stack, tmp_path: Path) -> None:
    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(made_up_policies([LABEL]).to_bytes())
    heard: dict[str, list[Clock]] = {"/left/clock": [], "/right/clock": []}
    for topic, stamps in heard.items():
        stack.node.create_subscription(Clock, topic, stamps.append, QoSProfile(depth=100))
    both = {
        side: started(
            stack,
            "play",
            f"namespace:=/{side}",
            f"checkpoint:={checkpoint}",
            f"labels:={LABEL}",
            "balls:=2",
            f"report:={tmp_path / side}.json",
        )
        for side in ("left", "right")
    }
    stack.wait_until(lambda: all(heard.values()), "ticks of both clocks", END_S, both["right"])
    assert stack.node.count_publishers("/clock") == 0
    assert [stack.node.count_publishers(topic) for topic in heard] == [1, 1]
    for side, process in both.items():
        assert process.wait(END_S) == 0, process.output
        process.wait_for_line(
            rf"^\[up\] play: starts simulator, executor, evaluator on domain {stack.domain_id} .*/{side}$"
        )
        process.wait_for_line(rf"^\[up\] report {re.escape(str(tmp_path / side))}\.json$")
        process.wait_for_line(r"^\[simulator\] \[INFO\] ready: lockstep")
        row = json.loads((tmp_path / f"{side}.json").read_text())["labels"][str(LABEL)]
        assert row["fed"] == 2
        assert row["returned"] + sum(row["miss_reasons"].values()) == 2


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_one_signal_ends_all_in_order(stack: Stack, tmp_path: Path) -> None:
    process = started(stack, "teach", f"bags:={tmp_path}", "subjects:=1")
    process.wait_for_line(r"^\[recorder\] \[INFO\] ready", END_S)
    nodes = children(process)
    assert set(nodes) == {"simulator", "recorder", "demonstrator"}
    process.send_signal(signal.SIGINT)
    assert process.wait(END_S) == 0, process.output
    process.wait_for_line(r"^\[up\] ends demonstrator, recorder, simulator$")
    assert not any(map(_runs, nodes.values()))
    assert "Traceback" not in process.output


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_a_killed_node_is_named_and_takes_the_others_along(stack: Stack) -> None:
    process = started(stack, "play", "balls:=0")
    for name in ("executor", "simulator"):
        process.wait_for_line(rf"^\[{name}\] \[INFO\] ready", END_S)
    nodes = children(process)
    os.kill(nodes["simulator"], signal.SIGKILL)
    assert process.wait(END_S) == 1, process.output
    process.wait_for_line(
        r"^up: error: simulator was ended by signal 9 \(SIGKILL\); its last line: \[INFO\] "
    )
    assert not any(map(_runs, nodes.values()))


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_a_node_that_refuses_its_parameters_is_quoted(stack: Stack, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("/**/executor:\n  ros__parameters: {mode: banana}\n")
    process = started(stack, "play", "balls:=0", f"params_file:={file}")
    assert process.wait(END_S) == 1, process.output
    process.wait_for_line(
        r"^up: error: executor ended with exit status 2; its last error line: executor: error: .*banana"
    )


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_a_node_comes_again_and_none_outlives_up(stack: Stack) -> None:
    process = started(stack, "play", "balls:=0", "respawn:=true")
    process.wait_for_line(r"^\[executor\] \[INFO\] ready", END_S)
    first = children(process)
    os.kill(first["executor"], signal.SIGKILL)
    process.wait_for_line(r"^\[up\] executor was ended by signal 9 .* it is started again in 1 s$", END_S)
    stack.wait_until(lambda: children(process).get("executor", first["executor"]) != first["executor"], "it")
    second = children(process)
    assert second["simulator"] == first["simulator"]
    process.send_signal(signal.SIGKILL)
    await_end(second)
