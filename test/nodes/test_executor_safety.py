"""When the executor moves an arm and when not: clocks, silence, stops, several arms, impossible states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.time import Time
from sensor_msgs.msg import JointState

from live_executor import RESTING, LiveExecutor, flying, joint_state, live_executor, require_safe
from made_up_policies import made_up_policies
from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.player import Phase
from sawyer import HOME_POSTURE_RAD, JOINT_NAMES, POSITION_UPPER_RAD

LABEL = ALL_LABELS[0]
POLICIES = made_up_policies((LABEL,), gain=1.0)
HOUR_NS = 3_600 * 10**9


@pytest.fixture
def arm(domain_id: int) -> Iterator[LiveExecutor]:
    """On a real robot, in its ready pose."""
    with live_executor(domain_id, mode="real_time") as one:
        one.policies(POLICIES.to_bytes())
        one.make_ready(LABEL)
        yield one


@pytest.fixture
def lockstep(domain_id: int) -> Iterator[LiveExecutor]:
    """In a simulation in lockstep, in its ready pose."""
    with live_executor(domain_id) as one:
        one.policies(POLICIES.to_bytes())
        one.make_ready(LABEL)
        yield one


def require_rest(arm: LiveExecutor, within_s: float = 0.6) -> None:
    """The arm comes to rest though joint states keep coming, and stays there."""
    for _ in range(round(within_s / CONTROL_PERIOD_S)):
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        arm.wait(CONTROL_PERIOD_S)
        arm.joints()
        arm.follow()
    assert not arm.moves
    require_safe(arm.commands, pauses=True)


def stamped(position: NDArray[np.float64], stamp_ns: int) -> JointState:
    """A joint state of a time."""
    state = joint_state(position)
    state.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    return state


def strokes(arm: LiveExecutor) -> int:
    """How many strokes have begun."""
    assert arm.node._player is not None
    return arm.node._player.strokes_begun


def test_a_parameter_stops_the_arm_as_the_service_does(arm: LiveExecutor) -> None:
    arm.swing()
    arm.node.change("enabled", False)
    for step in range(20, 50):
        arm.tick(flying(step))
    assert not arm.moves
    require_safe(arm.commands)
    # Held: said once, and then nothing more.
    sent = len(arm.commands)
    arm.tick()
    assert len(arm.commands) == sent
    arm.node.change("enabled", True)
    arm.make_ready(LABEL)
    arm.swing()
    require_safe(arm.commands, pauses=True)


def test_an_arm_that_was_led_elsewhere_while_disabled_is_commanded_from_there(arm: LiveExecutor) -> None:
    arm.node.change("enabled", False)
    arm.tick()
    arm.commands.clear()
    led = arm.position = arm.position + 0.3
    for _ in range(50):
        arm.tick()
    assert arm.commands == []
    arm.node.change("enabled", True)
    arm.tick()
    first = np.array(arm.commands[0].points[0].positions)
    assert np.abs(first - led).max() < 0.02


@pytest.mark.parametrize(
    ("offset_ns", "words"),
    [(HOUR_NS, "3600 s ahead of"), (-5 * 10**9, "5 s behind"), (-400_000_000, "0.4 s behind")],
)
def test_a_camera_with_another_clock_is_named_and_no_stroke_begins(
    arm: LiveExecutor, offset_ns: int, words: str
) -> None:
    arm.stamp_ns += 10 * 10**9
    arm.wait(10.0)
    for step in range(40):
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        arm.wait(CONTROL_PERIOD_S)
        arm.ball(flying(max(step - 15, 0)), arm.stamp_ns + offset_ns)
        arm.joints()
        arm.follow()
    assert strokes(arm) == 0
    line = f"stamps of ball/position are {words} those of joint_states"
    assert [said for said in arm.said if line in said], arm.said
    assert any(line in reason for reason in arm.node.waits_for())


def test_a_camera_that_runs_ahead_and_falls_silent_in_mid_stroke_stops_the_arm(arm: LiveExecutor) -> None:
    """Within what clocks may differ, so that the stroke begins; judged by arrival, the silence is found."""
    for step in range(25):
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        arm.wait(CONTROL_PERIOD_S)
        arm.ball(flying(max(step - 5, 0)), arm.stamp_ns + 140_000_000)
        arm.joints()
        arm.follow()
    assert arm.moves
    assert strokes(arm) == 1
    require_rest(arm, within_s=0.4)
    assert any("stale in mid-stroke" in line for line in arm.said)


def test_a_camera_whose_stamps_stand_still_stops_the_arm(arm: LiveExecutor) -> None:
    arm.swing()
    stands_ns = arm.stamp_ns
    for step in range(20, 45):
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        arm.wait(CONTROL_PERIOD_S)
        arm.ball(flying(step), stands_ns)
        arm.joints()
        arm.follow()
    assert not arm.moves
    assert any("stamps of ball/position stand still" in line for line in arm.said)
    require_safe(arm.commands)


def test_one_corrupted_stamp_of_the_ball_does_not_end_a_stroke(arm: LiveExecutor) -> None:
    arm.swing()
    arm.ball(flying(20), arm.stamp_ns + HOUR_NS)
    arm.tick(flying(21))
    assert arm.node._player is not None
    assert arm.node._player.phase is Phase.STROKE


def test_joint_states_whose_stamps_stand_still_stop_the_arm(arm: LiveExecutor) -> None:
    arm.swing()
    for step in range(20, 45):
        arm.wait(CONTROL_PERIOD_S)
        arm.ball(flying(step))
        arm.joints()
        arm.follow()
    assert not arm.moves
    assert any("stamps of joint_states stand still" in line for line in arm.said)
    require_safe(arm.commands)


def test_one_corrupted_stamp_of_the_joints_is_passed_over_and_a_clock_that_was_set_is_followed(
    arm: LiveExecutor,
) -> None:
    arm.swing()
    state = joint_state(arm.position)
    state.header.stamp = Time(nanoseconds=arm.stamp_ns + HOUR_NS).to_msg()
    arm.joints(state)
    assert any("stamps of joint_states leap" in line for line in arm.said)
    arm.tick(flying(20))
    assert arm.node._player is not None
    assert arm.node._player.phase is Phase.STROKE
    # Back by half a second, for good.
    arm.stamp_ns -= 500_000_000
    for step in range(21, 60):
        arm.tick(flying(step))
    assert any("starts afresh" in line for line in arm.said)
    arm.make_ready(LABEL)
    arm.swing()
    require_safe(arm.commands, pauses=True)


@pytest.mark.parametrize("value", [10.0, 1e308, float(np.degrees(1.0))])
def test_an_impossible_state_is_refused_and_the_arm_comes_to_rest(arm: LiveExecutor, value: float) -> None:
    arm.swing()
    for step in range(20, 35):
        wrong = arm.position.copy()
        wrong[3] = value
        state = joint_state(wrong)
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        state.header.stamp = Time(nanoseconds=arm.stamp_ns).to_msg()
        arm.wait(CONTROL_PERIOD_S)
        arm.ball(flying(step))
        arm.joints(state)
    assert not arm.moves
    require_safe(arm.commands)
    (line,) = {line for line in arm.said if "joint_states" in line}
    assert f"joint right_j3 is at {value:.4g} rad, its limit is {POSITION_UPPER_RAD[3]:.4g}" in line
    assert "degrees" in line
    arm.make_ready(LABEL)


def test_an_arm_that_is_measured_beyond_its_limits_at_the_start_is_not_moved(domain_id: int) -> None:
    with live_executor(domain_id, mode="real_time") as arm:
        arm.position = np.degrees(arm.position)
        for _ in range(20):
            arm.tick()
        assert arm.commands == []


@pytest.mark.parametrize(
    "state",
    [
        JointState(),
        JointState(name=list(JOINT_NAMES)),
        JointState(name=list(JOINT_NAMES), position=[0.1] * 6),
        JointState(name=list(JOINT_NAMES), position=[np.nan] * 7, velocity=[0.0] * 7),
        JointState(name=["gripper"], position=[0.02]),
    ],
)
def test_joint_states_that_tell_nothing_are_not_answered_and_work_goes_on(
    lockstep: LiveExecutor, state: JointState
) -> None:
    sent = len(lockstep.commands)
    state.header.stamp = Time(nanoseconds=lockstep.stamp_ns + 1).to_msg()
    lockstep.joints(state)
    assert len(lockstep.commands) == sent
    lockstep.swing()


def test_two_arms_on_one_topic_stop_the_arm_until_one_is_gone(arm: LiveExecutor) -> None:
    arm.swing()
    other = arm.position + 1.0
    for step in range(30):
        arm.tick(flying(20 + step))
        state = joint_state(other)
        state.header.stamp = Time(nanoseconds=arm.stamp_ns + 3_000_000).to_msg()
        arm.joints(state, sequence=500_000 + step)
    assert not arm.moves
    require_safe(arm.commands)
    assert any("2 sources tell of one arm" in line for line in arm.said)
    assert any("one arm instead of 2" in reason for reason in arm.node.waits_for())
    arm.wait(5.0)
    arm.make_ready(LABEL)


def test_a_simulator_that_is_started_again_is_followed(lockstep: LiveExecutor) -> None:
    lockstep.swing()
    home = lockstep.position
    lockstep.stamp_ns = 10**9
    lockstep.position = home + 0.2
    lockstep.tick()
    assert any("time is 1.020 s now; starts afresh" in line for line in lockstep.said)
    lockstep.make_ready(LABEL)
    for _ in range(100):
        lockstep.tick()
    before = strokes(lockstep)
    lockstep.swing()
    assert strokes(lockstep) == before + 1
    require_safe(lockstep.commands)


def test_a_ball_that_is_in_flight_when_the_arm_is_enabled_is_let_through(arm: LiveExecutor) -> None:
    arm.node.change("enabled", False)
    for step in range(5):
        arm.tick(flying(step))
    arm.node.change("enabled", True)
    for step in range(5, 25):
        arm.tick(flying(step))
    assert strokes(arm) == 0


def test_messages_that_waited_in_a_queue_do_not_make_the_arm_hurry(arm: LiveExecutor) -> None:
    arm.swing()
    sent = len(arm.commands)
    for step in range(20, 60):
        arm.stamp_ns += round(CONTROL_PERIOD_S * 1e9)
        arm.ball(flying(step))
        arm.joints()
    assert len(arm.commands) <= sent + 1


def test_the_ball_is_refused_where_there_is_no_room_for_it(lockstep: LiveExecutor) -> None:
    lockstep.ball(1000.0 * RESTING)
    assert any("out of any room; give it in metres" in line for line in lockstep.said)


def test_one_state_that_tells_another_place_leads_no_arm_there(arm: LiveExecutor) -> None:
    """Joints in another order are possible, too: after a pause the arm was once sent to where it was not."""
    arm.swing()
    arm.wait(1.5)
    arm.follow()
    elsewhere = arm.position[::-1].copy()
    assert np.abs(elsewhere - arm.position).max() > 1.0
    sent = len(arm.commands)
    for _ in range(20):
        arm.tick(state=stamped(elsewhere, arm.stamp_ns + round(CONTROL_PERIOD_S * 1e9)))
        arm.tick()
    assert len(arm.commands) == sent
    for _ in range(20):
        arm.tick()
    assert len(arm.commands) > sent
    require_safe(arm.commands)


def test_the_first_state_is_believed_once_others_agree(domain_id: int) -> None:
    with live_executor(domain_id, mode="real_time") as arm:
        arm.policies(POLICIES.to_bytes())
        arm.strategy(LABEL)
        arm.tick(state=stamped(arm.position[::-1], arm.stamp_ns + round(CONTROL_PERIOD_S * 1e9)))
        assert not arm.commands
        for _ in range(20):
            arm.tick()
        assert arm.commands
        np.testing.assert_allclose(arm.commands[0].points[0].positions, HOME_POSTURE_RAD, atol=0.02)
