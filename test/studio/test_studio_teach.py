"""Teaching in a real browser: sketched, varied and guided strokes become bags; nothing impossible moves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory

from browser import browser_path, open_page
from msrd_ros.bags.info import read_info
from msrd_ros.bags.reader import Bag
from msrd_ros.nodes.common import COMMAND, STATE
from msrd_ros.recordings.episodes import read_episodes
from sawyer import ROBOT, SPEED_LIMIT_RAD_S
from stack import START_TIMEOUT_S, Stack
from studio_stack import start_studio
from teach_page import (
    LED_S,
    begin_sketch,
    drag_ghost,
    follow_pacer,
    open_another,
    take_paddle,
    wait_until_free,
)

pytestmark = [pytest.mark.processes, pytest.mark.timeout(580)]

NAME = "my-lob"


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bags")


@pytest.fixture(scope="module")
def page(shared_stack: Stack, bags: Path) -> Iterator[Page]:
    browser_path()
    shared_stack.start("recorder", directory=bags)
    with open_page(start_studio(shared_stack, bags=bags)) as one:
        expect(one.locator("#phase")).to_contain_text("waits", timeout=1000 * START_TIMEOUT_S)
        begin_sketch(one, NAME)
        yield one


@pytest.fixture
def sketched(page: Page) -> Page:
    """The page with a fresh sketch that returns the ball."""
    page.locator("#teach-modes").get_by_role("button", name="Sketch").click()
    begin_sketch(page, NAME)
    return page


def _notes(bags: Path) -> dict[str, str]:
    """What each bag says of how it came about."""
    found = (read_info(path.parent) for path in bags.glob("s01/*/metadata.yaml"))
    return {info.path.name: info.custom_data.get("note", "") for info in found}


def _require_within_limits(bag: Path, label: str) -> None:
    (episode,) = read_episodes(Bag(bag), ROBOT)
    assert str(episode.label) == label
    assert episode.outcome is not None
    assert episode.outcome.returned
    assert (np.abs(episode.joint_velocity) <= 1.01 * SPEED_LIMIT_RAD_S).all()


def test_studio_teach_shows_in_red_what_the_arm_cannot_do(sketched: Page, shared_stack: Stack) -> None:
    page = sketched
    heard: list[JointState] = []
    subscription = shared_stack.node.create_subscription(JointState, "joint_states", heard.append, STATE)
    page.locator("#teach-swing").fill("0.15")
    wrong = page.locator("#teach-violations li")
    expect(wrong.first).to_contain_text("passed by")
    expect(wrong.first).to_contain_text("right_j")
    begin_sketch(page, NAME)
    drag_ghost(page, "contact", 180.0, 60.0)
    expect(page.locator("#teach-side-view .ghost.bad")).not_to_have_count(0)
    expect(wrong.first).to_contain_text("by")
    expect(page.locator("#teach-foretold")).to_have_text("The arm cannot do this:")
    expect(page.get_by_role("button", name="Lead it")).to_be_disabled()
    expect(page.get_by_role("button", name="Record variations")).to_be_disabled()
    shared_stack.wait_until(lambda: len(heard) > 5, "joint_states")
    positions = np.array([message.position for message in heard])
    assert np.ptp(positions, axis=0).max() < 1e-6
    shared_stack.node.destroy_subscription(subscription)


def test_studio_teach_foretells_where_the_ball_lands(sketched: Page) -> None:
    page = sketched
    before = page.locator("#teach-foretold").inner_text()
    drag_ghost(page, "follow-through", -6.0, -6.0)
    expect(page.locator("#teach-foretold")).not_to_have_text(before)
    expect(page.locator("#teach-foretold")).to_contain_text("Foretold:")


def test_studio_teach_leads_a_sketch_under_a_new_name(sketched: Page, bags: Path) -> None:
    page = sketched
    page.get_by_role("button", name="Lead it").click()
    expect(page.locator("#teach-verdict")).to_contain_text(f"kept as s01/{NAME}_001", timeout=1000 * LED_S)
    expect(page.locator("#teach-verdict")).to_contain_text("returned")
    wait_until_free(page)
    assert _notes(bags)[f"{NAME}_001"] == "sketched"
    _require_within_limits(bags / "s01" / f"{NAME}_001", NAME)
    expect(page.get_by_role("button", name="Stop the arm")).to_be_visible()
    expect(page.locator("#phase")).to_have_text("waits for a ball")


def test_studio_teach_keeps_discards_labels_and_does_again_by_keys(page: Page, bags: Path) -> None:
    wait_until_free(page)
    page.locator("#teach-verdict").click()
    page.keyboard.press("a")
    expect(page.locator("#teach-verdict")).to_contain_text("2. ", timeout=1000 * LED_S)
    wait_until_free(page)
    assert len(_notes(bags)) == 1, "the one before was thrown away"
    page.once("dialog", lambda dialog: dialog.accept("my-other"))
    page.keyboard.press("l")
    expect(page.locator("#teach-verdict")).to_contain_text("kept as s01/my-other_001")
    page.keyboard.press("k")
    expect(page.locator("#teach-keep")).to_be_disabled()
    page.keyboard.press("d")
    expect(page.locator("#teach-verdict")).to_contain_text("discarded")
    assert _notes(bags) == {}


def test_studio_teach_records_variations_that_say_so(sketched: Page, bags: Path) -> None:
    page = sketched
    page.locator("#teach-count").fill("2")
    page.locator("#teach-spread").select_option("easy")
    page.get_by_role("button", name="Record variations").click()
    expect(page.locator("#teach-series")).to_contain_text("2 of 2 variations kept", timeout=2000 * LED_S)
    wait_until_free(page)
    notes = list(_notes(bags).values())
    assert len(notes) == 2
    assert all(note.startswith("sketched variation") and NAME in note for note in notes)
    times = [read_episodes(Bag(path.parent), ROBOT)[0] for path in bags.glob("s01/*/metadata.yaml")]
    assert times[0].outcome is not None
    assert times[1].outcome is not None
    assert times[0].outcome.hit_time_s != times[1].outcome.hit_time_s


def test_studio_teach_guides_the_paddle_through_the_ball(sketched: Page, bags: Path) -> None:
    page = sketched
    before = set(_notes(bags))
    number = page.locator("#teach-strokes tbody tr").count() + 1
    take_paddle(page)
    follow_pacer(page, f"{number}. ")
    expect(page.locator("#teach-verdict")).to_contain_text("kept as")
    wait_until_free(page)
    (new,) = set(_notes(bags)) - before
    assert _notes(bags)[new] == "guided"
    _require_within_limits(bags / "s01" / new, NAME)


def test_studio_teach_lets_one_browser_lead_at_a_time(sketched: Page) -> None:
    page = sketched
    other = open_another(page, NAME)
    expect(other.get_by_role("button", name="Lead it")).to_be_enabled()
    page.get_by_role("button", name="Lead it").click()
    expect(other.locator("#teach-turn")).to_contain_text("browser 1 leads")
    expect(other.get_by_role("button", name="Lead it")).to_be_disabled()
    # Who presses nonetheless is told.
    other.evaluate("document.getElementById('teach-lead').disabled = false")
    other.locator("#teach-lead").dispatch_event("click")
    expect(other.locator("#said.bad")).to_contain_text("leads the arm; wait")
    other.close()
    wait_until_free(page)


def test_studio_teach_lets_go_when_the_browser_vanishes_in_a_drag(
    sketched: Page, shared_stack: Stack
) -> None:
    page = open_another(sketched, NAME)
    hands: list[MultiDOFJointTrajectory] = []
    node = shared_stack.node
    subscription = node.create_subscription(MultiDOFJointTrajectory, "teach/hand", hands.append, COMMAND)
    take_paddle(page)
    shared_stack.wait_until(lambda: hands and hands[-1].points, "hand")
    page.close()
    shared_stack.wait_until(lambda: not hands[-1].points, "a hand that lets go")
    states: list[JointState] = []
    joints = node.create_subscription(JointState, "joint_states", states.append, STATE)
    shared_stack.wait_until(lambda: states and not np.any(states[-1].velocity), "rest", LED_S)
    wait_until_free(sketched)
    expect(sketched.get_by_role("button", name="Stop the arm")).to_be_visible()
    for one in (subscription, joints):
        node.destroy_subscription(one)


def test_studio_teach_stop_takes_the_hand_off(sketched: Page) -> None:
    page = sketched
    page.get_by_role("button", name="Lead it").click()
    expect(page.locator("#teach-turn")).to_have_text("leading the paddle", timeout=1000 * LED_S)
    page.keyboard.press("Space")
    wait_until_free(page)
    expect(page.locator("#teach-series")).to_contain_text("stopped")
    expect(page.get_by_role("button", name="Let the arm move")).to_be_visible()
    page.get_by_role("button", name="Let the arm move").click()
    expect(page.get_by_role("button", name="Stop the arm")).to_be_visible()
