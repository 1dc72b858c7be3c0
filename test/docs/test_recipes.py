"""Files that recipes print: they are what they say they are, and name what there is."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from msrd_ros.contract.columns import DataContract
from msrd_ros.contract.interface import TOPICS
from msrd_ros.nodes.managed import LIFECYCLE_SERVICES
from msrd_ros.robots.loading import default_robot, load_robot
from processes import CHECKOUT


def blocks(page: str, language: str) -> list[str]:
    """Code blocks of a document."""
    text = (CHECKOUT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def test_the_controllers_move_all_joints_of_the_arm_and_take_the_executors_commands() -> None:
    (block,) = blocks("ros2_control.md", "yaml")
    nodes: dict[str, Any] = yaml.safe_load(block)["/**"]
    arm = nodes["arm_controller"]["ros__parameters"]
    assert tuple(arm["joints"]) == default_robot().joint_names
    assert {"position", "velocity"} <= set(arm["state_interfaces"])
    assert arm["interpolate_from_desired_state"]
    assert set(nodes["controller_manager"]["ros__parameters"]) - {"update_rate"} == set(nodes) - {
        "controller_manager"
    }


def test_the_mock_hardware_drives_a_joint_of_the_arm() -> None:
    (block,) = blocks("ros2_control.md", "xml")
    system = ElementTree.fromstring(block)
    assert system.findtext("hardware/plugin") == "mock_components/GenericSystem"
    assert {str(joint.get("name")) for joint in system.iter("joint")} <= set(default_robot().joint_names)


def test_the_policy_of_the_executor_names_topics_that_there_are() -> None:
    (block,) = blocks("security_enclaves.md", "xml")
    profile = ElementTree.fromstring(block).find(".//profile")
    assert profile is not None
    assert profile.get("node") == "executor"
    named = {str(topic.text) for topic in profile.iter("topic")}
    assert named - set(TOPICS) == {"/rosout", "/parameter_events", "~/transition_event"}
    assert set(LIFECYCLE_SERVICES) <= {service.text for service in profile.iter("service")}
    assert {"joint_command", "joint_states", "ball/position", "strategy", "policy"} <= named


def test_the_mapping_is_understood_and_names_the_joints_of_its_arm() -> None:
    (block,) = blocks("data_sets.md", "yaml")
    contract = DataContract.parse(yaml.safe_load(block), "data_sets.md")
    state, ball = contract.columns
    assert set(state.joints) == set(load_robot(contract.robot).joint_names)
    assert (ball.factor, contract.labels) == (1e-3, {"hit it high": "my-lob"})


@pytest.mark.parametrize("page", ["ros2_control.md", "security_enclaves.md"])
def test_what_was_not_run_is_said(page: str) -> None:
    text = (CHECKOUT / "docs" / page).read_text(encoding="utf-8")
    assert re.search(r"\*\*(Not run here|Needs a ROS 2 installation)\*\*", text)
