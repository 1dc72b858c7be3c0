"""The RViz configuration: every display shows a topic of its type, and asks for no more than is offered."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from message_fields import message_class
from msrd_ros.contract.interface import TOPICS
from msrd_ros.nodes.messages import WORLD
from processes import CHECKOUT

MANAGER = yaml.safe_load((CHECKOUT / "config" / "rviz" / "msrd_ros.rviz").read_text(encoding="utf-8"))[
    "Visualization Manager"
]
DISPLAYS: list[dict[str, Any]] = MANAGER["Displays"]
SHOWS = {
    "rviz_default_plugins/RobotModel": "std_msgs/msg/String",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/PointStamped": "geometry_msgs/msg/PointStamped",
    "rviz_default_plugins/Odometry": "nav_msgs/msg/Odometry",
}
"""Which messages a display of RViz subscribes to."""
WITHOUT_TOPIC = {"rviz_default_plugins/Grid", "rviz_default_plugins/TF"}
WITH_TOPIC = [display for display in DISPLAYS if display["Class"] not in WITHOUT_TOPIC]


def topic_of(display: dict[str, Any]) -> dict[str, Any]:
    """The topic of a display and its quality of service."""
    key = "Description Topic" if display["Class"].endswith("/RobotModel") else "Topic"
    found: dict[str, Any] = display[key]
    return found


def test_arm_frames_and_scene_are_shown() -> None:
    classes = {display["Class"] for display in DISPLAYS}
    assert {"rviz_default_plugins/RobotModel", "rviz_default_plugins/TF"} <= classes
    assert {topic_of(display)["Value"] for display in WITH_TOPIC} >= {"/robot_description", "/scene"}
    assert all(display["Value"] == display["Enabled"] for display in DISPLAYS)


def test_all_stands_in_the_frame_of_the_stack() -> None:
    assert MANAGER["Global Options"]["Fixed Frame"] == WORLD
    assert MANAGER["Views"]["Current"]["Target Frame"] == WORLD
    assert [one["Reference Frame"] for one in DISPLAYS if "Reference Frame" in one] == [WORLD]


@pytest.mark.parametrize("display", WITH_TOPIC, ids=lambda display: str(display["Name"]))
def test_a_display_fits_its_topic(display: dict[str, Any]) -> None:
    topic = topic_of(display)
    facts = TOPICS[topic["Value"].removeprefix("/")]
    assert facts.type_name == SHOWS[display["Class"]]
    assert message_class(facts.type_name)
    # All publishers are reliable; a volatile reader of a latched topic would miss what was said before it.
    assert topic["Reliability Policy"] == "Reliable"
    assert topic["Durability Policy"] == ("Transient Local" if facts.latched else "Volatile")
    assert topic["History Policy"] == "Keep Last"
    assert 1 <= topic["Depth"] <= facts.depth


def test_names_are_told_apart() -> None:
    names = [display["Name"] for display in DISPLAYS]
    assert len(set(names)) == len(names)
