"""Tables that people wrote name all that the code knows: keys of a robot, extras, former names."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from importlib.metadata import metadata
from typing import Any

import pytest
import yaml

from msrd_ros.learning import checkpoints
from msrd_ros.nodes.parameter_files import NODES, config_type
from msrd_ros.robots.loading import SHEET_FILE, robots_directory, shipped_robots
from processes import CHECKOUT


def page(name: str) -> str:
    return (CHECKOUT / name).read_text(encoding="utf-8")


def leaves(values: dict[str, Any]) -> Iterator[str]:
    """Last parts of all keys, those of spheres left out."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from leaves(value)
        else:
            yield key


@pytest.mark.parametrize("robot", shipped_robots())
def test_every_key_of_a_robot_is_explained(robot: str) -> None:
    sheet = yaml.safe_load((robots_directory() / robot / SHEET_FILE).read_text(encoding="utf-8"))
    keys = set(leaves(sheet))
    assert {"joints", "torque_nm", "keep_out"} <= keys
    assert not [key for key in sorted(keys) if f"{key}`" not in page("docs/own_robot.md")]


def test_every_extra_is_in_the_readme() -> None:
    extras = metadata("msrd_ros").get_all("Provides-Extra")
    assert extras
    assert not [name for name in extras if f"`{name}`" not in page("README.md")]


def test_every_former_name_is_in_the_table_of_what_loads() -> None:
    former = {
        (field.metadata["parameter"].former, field.name)
        for node in NODES
        for field in dataclasses.fields(config_type(node))
        if field.metadata["parameter"].former
    }
    assert former
    for before, now in former | set(checkpoints._RENAMED.items()):
        assert f"`{before}`" in page("docs/compatibility.md")
        assert f"`{now}`" in page("docs/compatibility.md")
