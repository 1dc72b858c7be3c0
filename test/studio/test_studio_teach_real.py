"""Beside a real arm nothing is led before it is enabled on the page that is to lead."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from browser import browser_path, open_page
from msrd_ros.nodes.common import COMMAND
from stack import Stack
from studio_stack import start_page, wait_for_page
from teach_page import begin_sketch

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]

NAME = "my-lob"


class RealArm:
    """What the driver of a real arm offers and hears beside its joint states."""

    def __init__(self, stack: Stack) -> None:
        self.asked: list[bool] = []
        self.commands: list[object] = []
        node = stack.node
        node.create_service(SetBool, "simulator/teach", self._on_teach)
        node.create_subscription(JointTrajectory, "joint_command", self.commands.append, COMMAND)
        node.create_subscription(MultiDOFJointTrajectory, "teach/hand", self.commands.append, COMMAND)

    def _on_teach(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.asked.append(request.data)
        response.success = True
        return response


def test_studio_teach_leads_a_real_arm_only_where_it_was_enabled(stack: Stack, tmp_path: Path) -> None:
    browser_path()
    arm = RealArm(stack)
    stack.start("recorder", directory=tmp_path)
    address = wait_for_page(stack, start_page(stack, mode="real_time", bags=tmp_path))
    with open_page(address) as page:
        begin_sketch(page, NAME)
        stack.wait_until(lambda: "recorder" in stack.diagnostics, "recorder")
        page.get_by_role("button", name="Lead it").click()
        expect(page.locator("#said.bad")).to_contain_text("may be a real arm; press Enable leading first")
        assert (arm.asked, arm.commands) == ([], [])
        page.get_by_role("button", name="Enable leading a real arm").click()
        expect(page.locator("#said")).to_contain_text("this page may lead the arm now")
        assert (arm.asked, arm.commands) == ([], [])
        page.get_by_role("button", name="Lead it").click()
        stack.wait_until(lambda: arm.asked, "the arm to be taken")
        assert arm.asked[0] is False
