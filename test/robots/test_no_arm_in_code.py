"""An arm is data: outside of the robots' room no code names one, its joints or its links, or counts them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from msrd_ros.robots.loading import load_robot, shipped_robots
from processes import CHECKOUT, PACKAGE

ROOT = CHECKOUT / PACKAGE
ARMS = tuple(load_robot(name) for name in shipped_robots())
NAMES = {name for arm in ARMS for name in (arm.name, *arm.joint_names, *arm.link_names)}
FREEDOMS_OF_A_BODY = 6
"""Of a pose or twist, whatever the arm: a number that says nothing about joints."""
COUNTS = {arm.joint_count for arm in ARMS} - {FREEDOMS_OF_A_BODY}
NUMERALS = dict(enumerate(["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"]))
MAKERS = {"zeros", "ones", "empty", "full", "range"}


def names_of_arms(text: str) -> Iterator[str]:
    """Lines that name an arm, a joint or a link of one."""
    pattern = re.compile(rf"(?<![a-z0-9])(?:{'|'.join(sorted(map(re.escape, NAMES)))})(?![a-z0-9])", re.I)
    for number, line in enumerate(text.splitlines(), 1):
        if pattern.search(line):
            yield f"{number}: {line.strip()}"


def counts_of_joints(text: str) -> Iterator[str]:
    """Lines that know how many joints there are: in words, or as the size of an array of joints."""
    words = "|".join(str(word) for count in COUNTS for word in (count, NUMERALS[count]))
    said = re.compile(rf"\b(?:{words})[ -](?:joints?|dof)\b|\bjoint_?count\w* *(?:==|!=|=) *[0-9]", re.I)
    for number, line in enumerate(text.splitlines(), 1):
        if said.search(line):
            yield f"{number}: {line.strip()}"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            function = node.func
            name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
            sizes = [word.value for word in node.keywords if word.arg in ("size", "shape")]
            sizes += node.args[:1] if name in MAKERS else []
            whole = [
                part for size in sizes for part in (size.elts if isinstance(size, ast.Tuple) else [size])
            ]
            for part in whole:
                if isinstance(part, ast.Constant) and part.value in COUNTS:
                    yield f"{node.lineno}: {ast.unparse(node)}"


def sources() -> list[Path]:
    return sorted(path for path in ROOT.rglob("*.py") if path.relative_to(ROOT).parts[0] != "robots")


def test_no_file_names_an_arm_or_counts_its_joints() -> None:
    found = []
    for path in sources():
        text = path.read_text(encoding="utf-8")
        found += [
            f"{path.relative_to(CHECKOUT)}:{line}" for line in (*names_of_arms(text), *counts_of_joints(text))
        ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "line",
    ["# as the Sawyer does", "JOINT = 'right_j6'", "ur10e = 1", "link = 'forearm_link'", "sawyer_urdf()"],
)
def test_a_name_is_found(line: str) -> None:
    assert list(names_of_arms(line)) == [f"1: {line}"]


@pytest.mark.parametrize(
    "line",
    [
        "np.zeros(7)",
        "np.empty((n, 7))",
        "rng.normal(size=(5, 7))",
        "range(7)",
        "# seven joints",
        "JOINT_COUNT = 7",
    ],
)
def test_a_count_is_found(line: str) -> None:
    assert list(counts_of_joints(line)) == [f"1: {line}"]


@pytest.mark.parametrize("line", ["ball[7]", "np.zeros(6)", "fontsize = 7", "seed = [seed, 7]"])
def test_other_numbers_are_not_taken_for_counts(line: str) -> None:
    assert not list(counts_of_joints(line))
