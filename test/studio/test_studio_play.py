"""Playing in a real browser: which balls come, which strategy meets them, and that stop means stop."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from playwright.sync_api import Page, expect
from sensor_msgs.msg import JointState

from browser import browser_path, open_page
from msrd_ros.nodes.common import EVENT, STATE
from msrd_ros.nodes.messages import feed_from_message
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.aim import aimed_feed
from stack import START_TIMEOUT_S, Stack
from studio_stack import start_studio

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]

STEP_S = 0.02


@pytest.fixture(scope="module")
def page(shared_stack: Stack) -> Iterator[Page]:
    browser_path()
    address = start_studio(shared_stack)
    with open_page(address) as one:
        expect(one.locator("#phase")).to_contain_text("waits", timeout=1000 * START_TIMEOUT_S)
        yield one


@pytest.fixture
def feeds(shared_stack: Stack) -> Iterator[list[Odometry]]:
    heard: list[Odometry] = []
    subscription = shared_stack.node.create_subscription(Odometry, "feed", heard.append, EVENT)
    shared_stack.wait_until(lambda: shared_stack.node.count_publishers("feed"), "feed")
    # The studio has to find the subscriber, too.
    found_s = time.monotonic() + 1.0
    shared_stack.wait_until(lambda: time.monotonic() > found_s, "pause")
    yield heard
    shared_stack.node.destroy_subscription(subscription)


def test_studio_play_feeds_the_ball_that_the_sliders_say(
    page: Page, shared_stack: Stack, feeds: list[Odometry]
) -> None:
    page.get_by_role("button", name="my own").click()
    for name, value in (("speed", "6"), ("backspin", "-40"), ("x", "-0.9"), ("y", "0.2")):
        page.locator(f"#{name}").fill(value)
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#said")).to_contain_text("backspin -40 rad/s, to x -0.9, y 0.2 m")
    message = shared_stack.wait_until(lambda: feeds, "feed")[0]
    expected = aimed_feed((-0.9, 0.2), 6.0, -40.0)
    found = feed_from_message(message)
    np.testing.assert_allclose(found.velocity, expected.velocity)
    np.testing.assert_allclose(found.spin, expected.spin)


def test_studio_play_says_what_no_ball_can_do(page: Page, feeds: list[Odometry]) -> None:
    page.locator("#speed").fill("3")
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#said.bad")).to_contain_text("choose another speed, spin or place")
    assert feeds == []
    page.get_by_role("button", name="standard").click()


def test_studio_play_feeds_on_and_on_until_told_not_to(page: Page) -> None:
    page.get_by_role("button", name="backhand-push", exact=True).click()
    page.get_by_role("button", name="Feed on and on").click()
    row = page.locator("#rates tbody tr").filter(has_text="backhand-push")
    expect(row.locator("td").nth(1)).to_have_text("3")
    page.get_by_role("button", name="No more balls").click()
    expect(page.get_by_role("button", name="Feed on and on")).to_be_visible()
    expect(page.locator("#phase")).to_have_text("waits for a ball")
    fed = row.locator("td").nth(1).inner_text()
    page.wait_for_timeout(4000)
    assert int(row.locator("td").nth(1).inner_text()) <= int(fed) + 1


def test_studio_play_space_stops_the_arm_within_its_limits(page: Page, shared_stack: Stack) -> None:
    heard: list[JointState] = []
    subscription = shared_stack.node.create_subscription(JointState, "joint_states", heard.append, STATE)
    page.get_by_role("button", name="forehand-topspin", exact=True).click()
    page.get_by_role("button", name="Feed a ball").click()

    def speed() -> float:
        return float(np.abs(heard[-1].velocity).max()) if heard else 0.0

    shared_stack.wait_until(lambda: heard and heard[-1].header.frame_id and speed() > 0.5, "stroke")
    page.keyboard.press("Space")
    shared_stack.wait_until(lambda: speed() == 0.0, "rest")
    expect(page.get_by_role("button", name="Let the arm move")).to_be_visible()
    expect(page.locator("#phase")).to_have_text("stopped")
    limits = load_robot("sawyer").limits
    joints = {message.header.stamp.sec * 10**9 + message.header.stamp.nanosec: message for message in heard}
    velocity = np.array([joints[stamp].velocity for stamp in sorted(joints)])
    assert (np.abs(velocity) <= limits.speed_rad_s * (1 + 1e-6)).all()
    # Space again gives no leave to move; the button does.
    stood = list(heard[-1].position)
    page.keyboard.press("Space")
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#said.bad")).to_contain_text("the arm is stopped and would miss it")
    heard.clear()
    shared_stack.wait_until(lambda: len(heard) > 50, "joint_states")
    np.testing.assert_allclose(heard[-1].position, stood, atol=1e-6)
    page.get_by_role("button", name="Let the arm move").click()
    expect(page.get_by_role("button", name="Stop the arm")).to_be_visible()
    page.get_by_role("button", name="Feed a ball").click()
    expect(page.locator("#phase")).to_have_text("plays")
    shared_stack.node.destroy_subscription(subscription)


def test_studio_play_takes_any_well_formed_name_and_no_other(page: Page) -> None:
    page.locator("#other-name").fill("my-smash")
    page.get_by_role("button", name="Play it").click()
    expect(page.locator("#said")).to_contain_text("my-smash from the next ball on")
    page.evaluate("document.getElementById('other').noValidate = true")
    page.locator("#other-name").fill("No Name")
    page.get_by_role("button", name="Play it").click()
    expect(page.locator("#said.bad")).to_contain_text("no strategy label")
