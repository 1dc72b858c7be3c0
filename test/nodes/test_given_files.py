"""Parameter files: which sections are for a node, as ROS reads them, and what is said of the others."""

from __future__ import annotations

from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.given_files import given_files, require_section

OTHERS = ("executor", "simulator", "recorder")


def write(folder: Path, *sections: str) -> Path:
    file = folder / "given.yaml"
    file.write_text("".join(f"{name}:\n  ros__parameters:\n    seed: 7\n" for name in sections))
    return file


@pytest.mark.parametrize(
    ("section", "node"),
    [
        ("/**", "/executor"),
        ("/**", "/left/executor"),
        ("executor", "/executor"),
        ("/executor", "/executor"),
        ("/left/executor", "/left/executor"),
        ("left/executor", "/left/executor"),
        ("/**/executor", "/executor"),
        ("/**/executor", "/a/b/executor"),
        ("/*/executor", "/left/executor"),
        ("/left/*", "/left/executor"),
        ("executor", "/left/executor"),
        ("/right/executor", "/left/executor"),
        ("/*/executor", "/executor"),
        ("/*", "/left/executor"),
        ("exec", "/executor"),
    ],
)
def test_a_section_is_for_a_node_exactly_where_ros_takes_it(
    section: str, node: str, tmp_path: Path, domain_id: int
) -> None:
    file = write(tmp_path, section)
    namespace, _, name = node.rpartition("/")
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(file)], context=context, domain_id=domain_id)
    try:
        one = Node(name, namespace=namespace or "/", context=context)
        taken = "seed" in one._parameter_overrides
        one.destroy_node()
    finally:
        context.try_shutdown()
    if taken:
        assert require_section(file, node, OTHERS) == ""
        return
    with pytest.raises(UserError) as refused:
        require_section(file, node, OTHERS)
    assert str(file) in str(refused.value)
    assert f"call the section /** (for any node) or {node}" in str(refused.value)


def test_a_file_for_other_nodes_is_named_and_one_for_nobody_refused(tmp_path: Path) -> None:
    said = require_section(write(tmp_path, "simulator", "/**/recorder"), "/executor", OTHERS)
    assert "nothing in it is for /executor: it has /simulator, /**/recorder" in said
    with pytest.raises(UserError, match="it has /simulatr; call the section"):
        require_section(write(tmp_path, "simulatr"), "/executor", OTHERS)


def test_sections_may_be_written_level_by_level(tmp_path: Path) -> None:
    file = tmp_path / "nested.yaml"
    file.write_text("left:\n  executor:\n    ros__parameters:\n      seed: 7\n")
    assert require_section(file, "/left/executor", OTHERS) == ""
    with pytest.raises(UserError, match="it has /left/executor"):
        require_section(file, "/executor", OTHERS)


def test_files_are_found_on_the_command_line() -> None:
    words = ["--ros-args", "--params-file", "a.yaml", "-p", "seed:=1", "--params-file", "b.yaml"]
    assert given_files(words) == [Path("a.yaml"), Path("b.yaml")]
    assert given_files(["--ros-args", "--params-file"]) == []
