"""The sets of nodes: what they start exists, and is told as the nodes have it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msrd_ros.__main__ import EXECUTABLES
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.parameter_files import config_type
from msrd_ros.stack.sets import POLICIES_FILE, SETS, NodeCall, Part, RosOptions, Stage
from msrd_ros.table_tennis.strokes import training
from processes import CHECKOUT

FILE = str(Path(__file__))
SAID = {
    "robot": "ur10e",
    "mode": "real_time",
    "gui": "true",
    "seed": "7",
    "bags": "some_bags",
    "subjects": "2",
    "recordings": "4",
    "checkpoint": FILE,
    "labels": "one,another",
    "balls": "3",
    "report": "rates.json",
    "out": "some/where",
    "resume": "true",
    "iterations": "5",
    "namespace": "/left",
    "params_file": FILE,
    "log_level": "debug",
    "respawn": "true",
    "arm": "simulated",
    "run": "some/run",
    "runs": "some/runs",
    "port": "8090",
    "expose": "true",
    "token": "secret",
    "rallies": "4",
    "most_hits": "9",
}
"""Something for every argument."""


def stages(name: str, **texts: str) -> tuple[Stage, ...]:
    return SETS[name].stages(SETS[name].read(texts))


def all_said(name: str) -> tuple[Stage, ...]:
    return stages(name, **{argument.name: SAID[argument.name] for argument in SETS[name].arguments})


def calls(name: str) -> list[NodeCall]:
    return [call for stage in all_said(name) for call in stage.nodes]


@pytest.mark.parametrize("name", SETS)
def test_nodes_and_their_parameters_exist(name: str) -> None:
    for call in calls(name):
        assert call.executable in EXECUTABLES
        fields = {field.name: field for field in dataclasses.fields(config_type(call.executable))}
        for parameter, value in call.parameters.items():
            default = getattr(config_type(call.executable)(), parameter)
            assert type(value) is type(default), f"{call.executable} {parameter}"
            choices = fields[parameter].metadata["parameter"].choices
            assert not choices or value in choices


@pytest.mark.parametrize("name", SETS)
def test_each_stage_has_one_node_whose_end_is_its_end(name: str) -> None:
    for stage in all_said(name):
        assert [call.part for call in stage.nodes].count(Part.ENDS) == 1


@pytest.mark.parametrize("name", SETS)
def test_every_argument_has_an_effect(name: str) -> None:
    options = {"namespace", "params_file", "log_level", "respawn"}
    for argument in SETS[name].arguments:
        if argument.name in options:
            continue
        others = {one.name: SAID[one.name] for one in SETS[name].arguments if one is not argument}
        assert stages(name, **others, **_different(argument.name)) != all_said(name), argument.name


def _different(name: str) -> dict[str, str]:
    # The checkpoint has to be there; all others are left out, or else stand at their defaults.
    return {"checkpoint": {name: str(CHECKOUT / "README.md")}, "arm": {name: "real"}}.get(name, {})


@pytest.mark.parametrize("name", ["teach", "play", "train"])
def test_of_what_is_not_said_the_nodes_and_the_parameter_file_decide(name: str) -> None:
    texts = {"balls": "0"} if name == "play" else {}
    for stage in stages(name, **texts):
        for call in stage.nodes:
            assert set(call.parameters) <= {"timeout_s"}


@pytest.mark.parametrize("name", ["teach", "play", "train"])
def test_what_holds_where_nothing_is_said_is_told_as_the_nodes_have_it(name: str) -> None:
    values = SETS[name].read({one.name: SAID[one.name] for one in SETS[name].arguments})
    defaults: dict[str, set[str]] = {}
    for call in calls(name):
        for parameter, value in call.parameters.items():
            default: Any = getattr(config_type(call.executable)(), parameter)
            text = str(default).lower() if isinstance(default, bool) else str(default)
            for argument in (key for key, said in values.items() if said == value):
                defaults.setdefault(argument, set()).add(text)
    for one in SETS[name].arguments:
        told = one.unset.rpartition("else ")[2].removeprefix("./")
        if "else " in one.unset and " " not in told:
            assert defaults[one.name] == {told}, one.name


def test_playing_needs_policies_unless_they_are_waited_for() -> None:
    with pytest.raises(UserError, match=r"give checkpoint:=FILE.*balls:=0"):
        stages("play")
    (stage,) = stages("play", balls="0")
    assert [call.executable for call in stage.nodes] == ["simulator", "executor"]
    (stage,) = stages("play", checkpoint=FILE)
    assert [call.executable for call in stage.nodes] == ["simulator", "executor", "evaluator"]


def test_the_demo_plays_what_it_has_trained() -> None:
    record, train, play, film = stages("demo", out="here", seed="4")
    by_name = {call.executable: call.parameters for stage in (record, train) for call in stage.nodes}
    assert by_name["recorder"]["directory"] == "here/bags"
    assert by_name["player"]["bags"] == ["here/bags"]
    assert by_name["trainer"]["out"] == "here/training"
    for stage in (play, film):
        executor = next(call for call in stage.nodes if call.executable == "executor")
        assert executor.parameters["checkpoint"] == f"here/training/{POLICIES_FILE}"
    assert by_name["trainer"]["targets"] is True
    assert next(call for call in play.nodes if call.executable == "evaluator").parameters["targets"] is True
    seeds = [stage.nodes[0].parameters["seed"] for stage in (record, play, film)]
    assert seeds == [4, 5, 6]
    assert POLICIES_FILE == training.POLICIES_FILE


def test_options_become_ros_arguments() -> None:
    words = " ".join(RosOptions("/a/b", "some.yaml", "debug").words("executor"))
    assert words.startswith("-r __ns:=/a/b -r /clock:=clock ")
    assert words.endswith("--log-level a.b.executor:=debug --params-file some.yaml")
    assert "__ns" not in " ".join(RosOptions().words("executor"))


def test_the_description_needs_the_standard_library_alone() -> None:
    # `ros2 launch` reads it with the Python of the system, where the package's dependencies may be missing.
    code = "import sys; sys.path.insert(0, sys.argv[1]); import msrd_ros.stack.sets as s; print(*s.SETS)"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code, str(CHECKOUT)], capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == list(SETS), done.stderr
