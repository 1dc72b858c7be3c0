"""The Foxglove layout: every panel has its place, every topic, field and service that it names is there."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from typing import Any

import pytest
from std_srvs import srv

from message_fields import fields_of, follow, full_name
from msrd_ros.contract.interface import TOPICS
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import ROBOT_DESCRIPTION
from msrd_ros.nodes.messages import WORLD
from processes import CHECKOUT

LAYOUT = json.loads((CHECKOUT / "config" / "foxglove" / "msrd_ros.json").read_text(encoding="utf-8"))
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
NUMBERS = {"double", "float"}
DRAWN = {"visualization_msgs/msg/MarkerArray", "visualization_msgs/msg/Marker"}
"""What the 3D panel draws of the stack's types."""


def of_kind(kind: str) -> list[dict[str, Any]]:
    """Settings of all panels of a kind; there is one at least."""
    found = [settings for name, settings in PANELS.items() if name.startswith(f"{kind}!")]
    assert found, kind
    return found


def type_of(topic: str) -> str:
    """The contract's type of a topic by its full name."""
    assert topic.startswith("/"), topic
    known = topic if topic in TOPICS else topic[1:]
    assert known in TOPICS, f"no topic {topic}"
    return TOPICS[known].type_name


def split_path(path: str) -> tuple[str, str]:
    """Topic and way through its message of a message path."""
    ends = [path.index(mark) for mark in ".[{" if mark in path]
    end = min(ends, default=len(path))
    return path[:end], path[end:]


def places(node: Any) -> Iterator[str]:
    """Panels in the order of the mosaic."""
    if isinstance(node, str):
        yield node
    else:
        assert node["direction"] in ("row", "column")
        assert 0 < node["splitPercentage"] < 100
        yield from places(node["first"])
        yield from places(node["second"])


def test_every_panel_has_one_place() -> None:
    assert sorted(places(LAYOUT["layout"])) == sorted(PANELS)


def test_the_scene_shows_arm_and_markers_in_the_frame_of_the_stack() -> None:
    (scene,) = of_kind("3D")
    assert scene["followTf"] == WORLD
    assert scene["topics"]
    for topic in scene["topics"]:
        assert type_of(topic) in DRAWN
    layers = {layer["layerId"]: layer for layer in scene["layers"].values()}
    assert layers["foxglove.Grid"]["frameId"] == WORLD
    robot = layers["foxglove.Urdf"]
    assert robot["sourceType"] == "topic"
    assert robot["topic"] == f"/{ROBOT_DESCRIPTION}"
    assert type_of(robot["topic"]) == "std_msgs/msg/String"


@pytest.mark.parametrize(
    "path", [line["value"] for settings in PANELS.values() for line in settings.get("paths", [])]
)
def test_every_curve_is_a_number_of_a_message(path: str) -> None:
    topic, way = split_path(path)
    assert follow(type_of(topic), way) in NUMBERS


def test_raw_messages_are_of_topics_of_the_stack() -> None:
    shown = [split_path(settings["topicPath"]) for settings in of_kind("RawMessages")]
    for topic, way in shown:
        follow(type_of(topic), way)
    assert {topic for topic, _ in shown} == {"/rally/outcome", "/strategy"}


def test_what_is_published_is_a_whole_message_of_the_topics_type() -> None:
    for settings in of_kind("Publish"):
        assert settings["datatype"] == type_of(settings["topicName"])
        value = json.loads(settings["value"])
        require_fields(value, settings["datatype"])
        assert StrategyLabel.parse(value["frame_id"], "layout")


def require_fields(value: dict[str, Any], type_name: str) -> None:
    """Hold nested data against a message's fields."""
    fields = fields_of(type_name)
    assert set(value) == set(fields)
    for name, inner in value.items():
        if isinstance(inner, dict):
            require_fields(inner, full_name(fields[name]))
        else:
            assert isinstance(inner, str) == (fields[name] == "string")


def test_services_are_those_of_the_nodes() -> None:
    for settings in of_kind("CallService"):
        _, node, name = settings["serviceName"].split("/")
        source = (CHECKOUT / "msrd_ros" / "nodes" / f"{node}.py").read_text(encoding="utf-8")
        calls = [
            call.args
            for call in ast.walk(ast.parse(source))
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "self.create_service"
        ]
        kinds = {ast.literal_eval(args[1]): ast.unparse(args[0]) for args in calls}
        assert f"~/{name}" in kinds
        request = getattr(srv, kinds[f"~/{name}"]).Request
        assert set(json.loads(settings["requestPayload"])) == set(request.get_fields_and_field_types())


def test_diagnostics_are_diagnostics() -> None:
    for settings in of_kind("DiagnosticSummary"):
        assert type_of(settings["topicToRender"]) == "diagnostic_msgs/msg/DiagnosticArray"


@pytest.mark.parametrize(
    "path", [".position", ".position[0].x", ".posture[0]", ".header{frame_id==1}", ".header[0]", "position"]
)
def test_a_wrong_path_is_seen(path: str) -> None:
    if path == ".position":
        assert follow(TOPICS["joint_states"].type_name, path) not in NUMBERS
        return
    with pytest.raises(AssertionError):
        follow(TOPICS["joint_states"].type_name, path)
