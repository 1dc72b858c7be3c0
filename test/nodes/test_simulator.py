"""The simulator as a process: its topics, its services, what it refuses, and real time."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msrd_ros.contract.outcome import MissReason
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.nodes.common import COMMAND, LATCHED, STATE
from msrd_ros.nodes.messages import feed_to_message
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from processes import RunningProcess
from sawyer import HOME_POSTURE_RAD, JOINT_NAMES, POSITION_UPPER_RAD, SPEED_LIMIT_RAD_S
from stack import Stack
from table_side import TableSide

pytestmark = pytest.mark.processes

LABEL = ALL_LABELS[0]
PERIOD_NS = 20_000_000


@pytest.fixture(scope="module")
def simulator(shared_stack: Stack) -> RunningProcess:
    return shared_stack.start_simulator(seed=3)


@pytest.fixture(scope="module")
def side(shared_stack: Stack, simulator: RunningProcess) -> TableSide:
    one = TableSide(shared_stack.node)
    shared_stack.wait_until(lambda: one.states and one.balls, "ticks")
    for publisher in (one.command, one.strategy, one.feed):
        shared_stack.wait_until(publisher.get_subscription_count, publisher.topic_name)
    return one


def test_ticks_carry_all_joints_and_the_ball(shared_stack: Stack, side: TableSide) -> None:
    state = side.states[-1]
    assert tuple(state.name) == JOINT_NAMES
    assert state.header.frame_id == ""
    np.testing.assert_array_equal(state.position, HOME_POSTURE_RAD)
    assert len(state.velocity) == len(state.effort) == 7
    assert side.balls[-1].header.frame_id == "world"


def test_an_unanswered_tick_is_sent_again_and_only_its_own_answer_counts(
    shared_stack: Stack, side: TableSide
) -> None:
    first_ns = side.tick_ns
    heard = len(side.states)
    shared_stack.wait_until(lambda: len(side.states) >= heard + 2, "the tick again")
    assert {stamp_to_ns(state.header.stamp) for state in side.states[heard:]} == {first_ns}
    assert int(shared_stack.diagnosed("simulator")["asked_again"]) >= 2

    answer = side.answer(HOME_POSTURE_RAD)
    side.command.publish(answer)
    shared_stack.wait_until(lambda: side.tick_ns != first_ns, "the next tick")
    side.command.publish(answer)
    heard = len(side.states)
    shared_stack.wait_until(lambda: len(side.states) >= heard + 2, "the next tick again")
    # Three times the same answer is one period; an answer to a tick to come is none.
    assert side.tick_ns == first_ns + PERIOD_NS
    ahead = answer.header.stamp
    ahead.sec += 1
    side.answer(HOME_POSTURE_RAD, stamp=ahead)
    heard = len(side.states)
    shared_stack.wait_until(lambda: len(side.states) >= heard + 2, "the next tick again")
    assert side.tick_ns == first_ns + PERIOD_NS


def test_commands_beyond_a_limit_are_refused_by_joint_and_not_obeyed(
    shared_stack: Stack, side: TableSide, simulator: RunningProcess
) -> None:
    before_ns = side.tick_ns
    position = HOME_POSTURE_RAD.copy()
    position[3] = POSITION_UPPER_RAD[3] + 0.1
    side.answer(position)
    simulator.wait_for_line(
        r"joint right_j3 is sent to 3.144 rad .* beyond its limits; the command is not obeyed"
    )
    velocity = np.zeros(7)
    velocity[6] = math.nan
    refused = int(shared_stack.diagnosed("simulator")["refused"])
    side.answer(HOME_POSTURE_RAD, velocity)
    shared_stack.wait_until(
        lambda: int(shared_stack.diagnosed("simulator")["refused"]) == refused + 1, "another refusal"
    )
    assert side.tick_ns == before_ns
    np.testing.assert_array_equal(side.states[-1].position, HOME_POSTURE_RAD)


def test_feeds_and_strategies_that_cannot_be_are_refused(
    shared_stack: Stack, side: TableSide, simulator: RunningProcess
) -> None:
    message = feed_to_message(Feeder().nominal(Side.FOREHAND))
    message.header.frame_id = "camera"
    side.feed.publish(message)
    simulator.wait_for_line("topic feed: frame 'camera' is unknown; give the launch in frame 'world'")
    refused = int(shared_stack.diagnosed("simulator")["refused"])
    side.throw(Feed((1.5, 0.0, 1.0), (math.inf, 0.0, 0.0), (0.0, 0.0, 0.0)))
    side.ask("world")
    shared_stack.wait_until(
        lambda: int(shared_stack.diagnosed("simulator")["refused"]) == refused + 2, "two more refusals"
    )
    assert shared_stack.diagnosed("simulator")["feeds_waiting"] == "0"
    assert shared_stack.diagnosed("simulator")["strategy"] == ""


def test_one_outcome_for_every_ball(shared_stack: Stack, side: TableSide) -> None:
    side.ask(LABEL)
    side.throw(Feeder().nominal(LABEL.side))
    assert shared_stack.trigger("simulator/serve").success
    side.clear()
    side.stand(shared_stack, LABEL, lambda: len(side.outcomes) == 2, "two outcomes")
    end_ns = side.tick_ns + 50 * PERIOD_NS
    side.stand(shared_stack, LABEL, lambda: side.tick_ns >= end_ns, "a second more")
    assert [label for label, _ in side.outcomes] == [LABEL, LABEL]
    assert [outcome.ball_id for _, outcome in side.outcomes] == [0, 1]
    assert all(outcome.miss_reason is MissReason.MISSED for _, outcome in side.outcomes)
    ticks = side.rally_ticks()
    assert {tick.label for tick in ticks} == {str(LABEL)}
    # The label stands on every joint state from the launch to the outcome, on none after it.
    assert 2 * 1.9 <= len(ticks) * 0.02 <= 2 * 2.2
    assert side.states[-1].header.frame_id == ""
    stamps = np.array([tick.time_ns for tick in ticks])
    assert np.sort(np.diff(stamps))[:-1].tolist() == [PERIOD_NS] * (len(stamps) - 2)
    assert np.diff(stamps).max() > PERIOD_NS


def test_robot_and_scene_are_shown(shared_stack: Stack, side: TableSide) -> None:
    described: list[String] = []
    markers: list[MarkerArray] = []
    truths: list[Odometry] = []
    node: Node = shared_stack.node
    node.create_subscription(String, "robot_description", described.append, LATCHED)
    node.create_subscription(MarkerArray, "scene", markers.append, COMMAND)
    node.create_subscription(Odometry, "ball/odometry", truths.append, STATE)
    side.ask(LABEL)
    side.throw(Feeder().nominal(LABEL.side))
    side.clear()
    side.stand(
        shared_stack,
        LABEL,
        lambda: described and side.outcomes and truths and markers and len(markers[-1].markers) == 4,
        "description, markers and odometry",
    )
    names = {joint.get("name") for joint in ElementTree.fromstring(described[0].data).iter("joint")}
    assert set(JOINT_NAMES) <= names
    assert [marker.ns for marker in markers[-1].markers] == ["table", "net", "ball", "path"]
    assert {marker.header.frame_id for marker in markers[-1].markers} == {"world"}
    # The truth has the spin that no camera tells.
    assert any(abs(truth.twist.twist.angular.y) > 30.0 for truth in truths)


def test_pause_teach_and_reset(shared_stack: Stack, side: TableSide) -> None:
    assert shared_stack.set("simulator/pause", True).success
    paused_ns = side.tick_ns
    heard = len(side.states)
    side.answer(HOME_POSTURE_RAD)
    shared_stack.diagnosed("simulator")
    assert (side.tick_ns, len(side.states)) == (paused_ns, heard)
    assert shared_stack.set("simulator/pause", False).success

    assert shared_stack.set("simulator/teach", True).success
    assert shared_stack.diagnosed("simulator")["message"] == "teaching"
    side.answer(HOME_POSTURE_RAD)
    shared_stack.diagnosed("simulator")
    assert side.tick_ns == paused_ns
    assert shared_stack.set("simulator/teach", False).success

    # With a ball in play teaching has to wait, and a reset calls the ball off.
    side.ask(LABEL)
    side.throw(Feeder().nominal(LABEL.side))
    side.clear()
    side.stand(shared_stack, LABEL, lambda: side.rally_ticks(), "launch")
    refused = shared_stack.set("simulator/teach", True)
    assert not refused.success
    assert "a ball is in play" in refused.message
    assert shared_stack.trigger("simulator/reset").success
    shared_stack.wait_until(lambda: side.outcomes, "outcome of the ball that was called off")
    assert [outcome.miss_reason for _, outcome in side.outcomes] == [MissReason.UNDECIDED]


def test_in_real_time_an_arm_without_commands_comes_to_rest(stack: Stack) -> None:
    stack.start_simulator(mode="real_time", joint_state_rate_hz=100.0)
    side = TableSide(stack.node)
    stack.wait_until(lambda: side.states and side.command.get_subscription_count(), "simulator")
    velocity = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0])
    side.answer(HOME_POSTURE_RAD + velocity * 0.01, velocity)
    stack.wait_until(lambda: np.abs(side.states[-1].velocity).max() > 0.5, "motion")
    moved = len(side.states)
    stack.wait_until(lambda: not np.any(side.states[-1].velocity), "rest")
    resting = np.array(side.states[-1].position)
    assert np.all(np.abs(resting - HOME_POSTURE_RAD) < 0.2)
    end_ns = side.tick_ns + 500_000_000
    stack.wait_until(lambda: side.tick_ns > end_ns, "half a second more")
    np.testing.assert_array_equal(side.states[-1].position, resting)
    speeds = np.abs([state.velocity for state in side.states[moved:]])
    assert np.all(speeds <= SPEED_LIMIT_RAD_S * 1.01)
    assert stack.diagnosed("simulator")["limits_exceeded"] == "0"
