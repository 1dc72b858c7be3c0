"""Every shell command of the documents is run: by a test, or here; or the document says why not.

A document says so with ``<!-- not run: REASON -->`` on the line before the block.
"""

from __future__ import annotations

import dataclasses
import re
import shlex
import subprocess
from typing import NamedTuple

import pytest

from msrd_ros.nodes.parameter_files import NODES, config_type
from processes import CHECKOUT

PAGES = sorted(
    [*CHECKOUT.glob("*.md"), *(CHECKOUT / "docs").glob("*.md"), *(CHECKOUT / "benchmarks").glob("*.md")]
)
BLOCK = re.compile(r"(?:<!-- not run: (?P<reason>[^\n]+) -->\n)?```bash\n(?P<code>.*?)```", re.DOTALL)

TESTED_BY = {
    r"ros2 run msrd_ros simulator\b": "nodes/test_simulator.py::test_ticks_carry_all_joints_and_the_ball",
    r"ros2 run msrd_ros demonstrator\b": (
        "nodes/test_demonstrator.py::test_live_disk_and_played_strokes_are_the_same_arrays"
    ),
    r"ros2 run msrd_ros recorder\b": "nodes/test_recorder.py::test_a_returned_stroke_becomes_a_bag",
    r"ros2 run msrd_ros player\b": (
        "nodes/test_player.py::test_a_bag_is_played_byte_for_byte_in_its_own_time"
    ),
    r"ros2 run msrd_ros trainer\b": (
        "nodes/test_trainer.py::test_training_resumes_exactly_and_its_policies_are_taken_by_an_executor"
    ),
    r"ros2 run msrd_ros executor\b": (
        "nodes/test_executor.py::test_in_real_time_the_arm_comes_to_rest_when_joint_states_fall_silent"
    ),
    r"ros2 run msrd_ros evaluator\b": (
        "nodes/test_evaluator.py::test_balls_are_fed_counted_and_reported_and_who_is_missing_is_named"
    ),
    r"python -m msrd_ros explain\b": "explain/test_command.py::test_a_stroke_is_told_and_drawn",
    r"python -m msrd_ros doctor\b": (
        "stack/test_doctor.py::test_faults_are_found_and_a_healthy_stack_is_let_go"
    ),
    r"python -m msrd_ros up teach\b": "up/test_command.py::test_one_signal_ends_all_in_order",
    r"python -m msrd_ros up play\b": (
        "up/test_command.py::test_two_stacks_play_side_by_side_each_with_its_clock"
    ),
    r"python -m msrd_ros up rally\b": "nodes/test_match.py::test_two_arms_play_a_short_rally",
    r"python -m msrd_ros up train\b": "stack/test_sets.py::test_nodes_and_their_parameters_exist",
    r"python -m msrd_ros\.bags repair\b": ("bags/test_repair.py::test_the_command_says_where_it_put_the_bag"),
    r"python -m msrd_ros\.bags check\b": "recordings/test_check.py::test_a_folder_is_told_bag_by_bag",
    r"python -m msrd_ros\.bags list\b": (
        "recordings/test_editing_command.py::test_a_folder_is_listed_filtered_and_sorted"
    ),
    r"python -m msrd_ros\.bags (export|import) .*\b(?:lerobot|minari) (?!.*--mapping)": (
        "recordings/exchange/test_importing.py::test_all_bags_come_back_byte_for_byte"
    ),
    r"python -m msrd_ros\.bags import .*--mapping": (
        "recordings/exchange/test_from_columns.py::test_strokes_of_a_stranger_become_bags"
    ),
    r"python -m msrd_ros\.bags (relabel|trim|flag|unflag|discard|restore)\b": (
        "recordings/test_editing_command.py::test_a_bag_is_edited_and_all_is_taken_back"
    ),
}
"""Which test runs a command, if with values of its own."""

HERE = (r"make help$", r".* --help$")
"""Commands that are cheap enough to run here as they stand."""


class Command(NamedTuple):
    """A line of a bash block."""

    page: str
    text: str
    reason: str | None


def commands() -> list[Command]:
    """All commands of all pages, without comments."""
    found = []
    for page in PAGES:
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            code = block["code"].replace("\\\n", " ")
            lines = (re.sub(r"(^|\s)#.*", "", line).strip() for line in code.splitlines())
            name = page.relative_to(CHECKOUT).as_posix()
            found += [Command(name, " ".join(line.split()), block["reason"]) for line in lines if line]
    return found


COMMANDS = commands()


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: f"{command.page}: {command.text}"[:90])
def test_command_is_run_or_says_why_not(command: Command) -> None:
    if any(re.match(pattern, command.text) for pattern in HERE):
        result = subprocess.run(shlex.split(command.text), cwd=CHECKOUT, capture_output=True, timeout=60)
        assert result.returncode == 0, result.stderr
        return
    known = any(re.match(pattern, command.text) for pattern in TESTED_BY)
    assert known or command.reason, f"{command.page}: no test runs {command.text!r}, and nothing says why not"


@pytest.mark.parametrize("test", TESTED_BY.values())
def test_the_test_that_runs_it_exists(test: str) -> None:
    path, _, name = test.partition("::")
    assert re.search(rf"^def {name}\(", (CHECKOUT / "test" / path).read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize(
    "command",
    [command for command in COMMANDS if command.text.startswith("ros2 run") and " -p " in command.text],
    ids=lambda command: command.text[:90],
)
def test_its_parameters_are_declared(command: Command) -> None:
    node = command.text.split()[3]
    assert node in NODES
    declared = {field.name for field in dataclasses.fields(config_type(node))}
    given = set(re.findall(r"-p '?(\w+):=", command.text))
    assert given
    assert given <= declared, f"{command.page}: {node} has no {', '.join(sorted(given - declared))}"
