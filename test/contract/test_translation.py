"""The one translation between messages and arrays: joints by name, the ball's flight, a stroke's ticks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState

from msrd_ros.contract.episode import action_to_velocity, observation_names
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.contract.translation import (
    BallTracker,
    EpisodeAssembler,
    JointStateTranslator,
    read_ball_position,
    read_outcome,
)
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.messages import (
    command_from_message,
    command_to_message,
    feed_from_message,
    feed_to_message,
    gesture_from_message,
    gesture_to_message,
    outcome_to_message,
)
from msrd_ros.robots.limits import JointReference
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from sawyer import JOINT_NAMES, POSITION_UPPER_RAD, ROBOT, SPEED_LIMIT_RAD_S

LABEL = ALL_LABELS[2]
MS = 1_000_000
LAUNCH_NS = 5_000 * MS


def joint_state(names: list[str], **fields: list[float]) -> JointState:
    values = [float(index) for index in range(len(names))]
    return JointState(name=names, **{"position": values, "velocity": [-v for v in values], **fields})


# -- joints ------------------------------------------------------------------------------------------------


def test_joints_are_found_by_name_in_any_order_among_others() -> None:
    names = ["head_pan", *reversed(JOINT_NAMES), "right_gripper"]
    position, velocity = JointStateTranslator(ROBOT).read(joint_state(names))
    np.testing.assert_array_equal(position, [7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0])
    np.testing.assert_array_equal(velocity, -position)


def test_the_order_may_change_from_message_to_message() -> None:
    translator = JointStateTranslator(ROBOT)
    translator.read(joint_state(list(reversed(JOINT_NAMES))))
    position, _ = translator.read(joint_state(list(JOINT_NAMES)))
    np.testing.assert_array_equal(position, np.arange(7.0))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (joint_state(list(JOINT_NAMES[:6])), "right_j6 is missing"),
        (joint_state(list(JOINT_NAMES), velocity=[]), "tells no positions and velocities"),
        (
            joint_state(list(JOINT_NAMES), position=[0.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0.0]),
            "position of joint right_j2",
        ),
        (joint_state(list(JOINT_NAMES), velocity=[0.0] * 6 + [np.inf]), "velocity of joint right_j6"),
    ],
)
def test_joint_states_that_cannot_be_used_name_joint_and_topic(message: JointState, words: str) -> None:
    with pytest.raises(UserError, match=words) as raised:
        JointStateTranslator(ROBOT, "topic /lab/joint_states").read(message)
    assert str(raised.value).startswith("topic /lab/joint_states: ")


def test_a_joint_that_is_not_ours_may_be_broken() -> None:
    message = joint_state([*JOINT_NAMES, "head_pan"], position=[0.0] * 7 + [np.nan])
    assert np.isfinite(JointStateTranslator(ROBOT).read(message)[0]).all()


# -- ball --------------------------------------------------------------------------------------------------


def test_a_ball_that_is_nowhere_is_refused() -> None:
    message = PointStamped()
    message.point.y = np.nan
    with pytest.raises(UserError, match=r"topic ball/position: .* is not finite"):
        read_ball_position(message)


def track(*samples: tuple[int, float]) -> BallTracker:
    tracker = BallTracker()
    for time_ms, x in samples:
        tracker.add(np.array([x, 0.0, 1.0]), time_ms * MS)
    return tracker


def test_velocity_is_the_difference_of_the_last_two_samples() -> None:
    assert track((0, 1.5)).velocity.tolist() == [0.0, 0.0, 0.0]
    tracker = track((0, 1.5), (20, 1.4), (25, 1.3))
    assert tracker.velocity == pytest.approx([-20.0, 0.0, 0.0])
    # The same frame again, or an older one, changes nothing.
    tracker.add(np.array([9.0, 9.0, 9.0]), 25 * MS)
    tracker.add(np.array([9.0, 9.0, 9.0]), 20 * MS)
    assert tracker.velocity == pytest.approx([-20.0, 0.0, 0.0])
    assert tracker.position.tolist() == [1.3, 0.0, 1.0]


@pytest.mark.parametrize(
    ("samples", "fed"),
    [
        ([(0, 1.5), (20, 1.4)], True),
        ([(0, 1.5), (20, 1.499)], False),
        ([(0, -0.5), (20, -0.6)], False),
        ([(0, 1.5), (20, 1.4), (40, 1.3), (60, 1.2)], True),
        ([(0, 1.5), (20, 1.4), (40, 1.5)], False),
        ([(0, 0.1), (20, 0.0 + 1e-3), (40, -0.1)], True),
        ([(0, 1.0), (20, 0.9), (40, 1.5)], False),
        ([(0, -2.0), (20, 1.5)], False),
    ],
)
def test_a_ball_is_fed_while_it_comes(samples: list[tuple[int, float]], fed: bool) -> None:
    assert track(*samples).fed is fed


# -- a stroke ----------------------------------------------------------------------------------------------


def assemble(joint_ms: int = 4, ball_ms: int = 5, end_ms: int = 2000, horizon: int = 95) -> Any:
    """A ball launched at LAUNCH_NS; joints move linearly in time."""
    assembler = EpisodeAssembler(LABEL, "s01", "topics")
    for time in range(-200, end_ms + 1, joint_ms):
        now = time / 1000
        assembler.add_joints(LAUNCH_NS + time * MS, np.full(7, now), np.full(7, 2 * now))
    for time in range(-200, end_ms + 1, ball_ms):
        x = 1.5 - 5.0 * max(time, 0) / 1000
        assembler.add_ball(LAUNCH_NS + time * MS, np.array([x, 0.0, 1.0]))
    return assembler.assemble(horizon)


def test_a_stroke_begins_with_the_launch_and_is_sampled_every_control_period() -> None:
    episode = assemble()
    ticks = 0.02 * np.arange(96)
    assert episode.observations.shape == (96, len(observation_names(ROBOT)))
    np.testing.assert_allclose(episode.joint_position, np.repeat(ticks[:, None], 7, axis=1), atol=1e-12)
    np.testing.assert_allclose(episode.ball_position[:, 0], 1.5 - 5.0 * ticks, atol=1e-12)
    np.testing.assert_allclose(episode.ball_velocity[0], 0.0)
    np.testing.assert_allclose(episode.ball_velocity[1:, 0], -5.0)
    # The action of a step is the velocity at its end, as a fraction of the limit, as a command asks for it.
    np.testing.assert_allclose(
        action_to_velocity(ROBOT, episode.actions),
        np.clip(episode.joint_velocity[1:], -SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S),
        atol=1e-12,
    )


def test_ticks_of_lockstep_come_back_untouched() -> None:
    """One joint state and one sample per tick: nothing is interpolated, nothing rounded."""
    rng = np.random.default_rng(0)
    positions, velocities = rng.normal(size=(2, 100, 7))
    balls = np.column_stack([1.5 - 0.1 * np.arange(100), rng.normal(size=(100, 2)) * 0.01])
    assembler = EpisodeAssembler(LABEL)
    for step in range(100):
        time_ns = 1_234_567_000_000 + 20 * MS * step
        assembler.add_joints(time_ns, positions[step], velocities[step])
        assembler.add_ball(time_ns, balls[step])
        # Asked again: the same tick once more.
        assembler.add_joints(time_ns, positions[step], velocities[step])
        assembler.add_ball(time_ns, balls[step])
    episode = assembler.assemble()
    np.testing.assert_array_equal(episode.joint_position, positions[:96])
    np.testing.assert_array_equal(episode.joint_velocity, velocities[:96])
    np.testing.assert_array_equal(episode.ball_position, balls[:96])


def test_where_messages_end_too_early_the_stroke_is_refused() -> None:
    assert len(assemble(end_ms=1900).observations) == 96
    with pytest.raises(
        UserError, match=r"topics: the recording ends 1\.80 s after the launch; 1\.90 s are needed"
    ):
        assemble(end_ms=1800)


def test_nothing_and_a_ball_that_never_flies_are_refused() -> None:
    with pytest.raises(UserError, match="0 joint states and 0 ball positions are too few"):
        EpisodeAssembler(LABEL).assemble()
    assembler = EpisodeAssembler(LABEL, source="bag x")
    for time in range(10):
        assembler.add_joints(time * MS, np.zeros(7), np.zeros(7))
        assembler.add_ball(time * MS, np.ones(3))
    with pytest.raises(UserError, match="bag x: the ball never flies towards the robot"):
        assembler.assemble()


# -- there and back ----------------------------------------------------------------------------------------


def test_feeds_outcomes_commands_and_gestures_read_back_exactly() -> None:
    rng = np.random.default_rng(4)
    feed = Feeder().nominal(Side.BACKHAND)
    assert feed_from_message(feed_to_message(feed)) == feed
    outcome = Outcome(
        3, struck=True, miss_reason=None, hit_time_s=0.1 + 0.2, spin_y_rad_s=1 / 3, landing_x_m=0.7
    )
    label, read = read_outcome(outcome_to_message(outcome, LABEL, Time()))
    assert label == LABEL
    assert read.to_values() == outcome.to_values()
    missed = Outcome(4, struck=False, miss_reason=MissReason.MISSED)
    label, read = read_outcome(outcome_to_message(missed, None, Time()))
    assert (label, read.message) == (None, "missed")
    reference = JointReference(rng.uniform(-1.0, 1.0, 7), rng.uniform(-1.0, 1.0, 7))
    command = command_from_message(ROBOT, command_to_message(ROBOT, reference, LABEL, Time(), 0.02))
    np.testing.assert_array_equal(command.position, reference.position)
    np.testing.assert_array_equal(command.velocity, reference.velocity)
    assert (command.label, command.period_s) == (LABEL, 0.02)
    gesture = HandGesture(
        np.array([0.0, 0.25, 0.5]), *(rng.normal(size=(3, width)) for width in (3, 4, 3, 3))
    )
    again = gesture_from_message(gesture_to_message(gesture, Time()))
    assert again is not None
    for name in ("times_s", "positions", "quaternions", "velocities", "angular_velocities"):
        np.testing.assert_array_equal(getattr(again, name), getattr(gesture, name))


def command(**changes: Any) -> Any:
    message = command_to_message(ROBOT, JointReference(np.zeros(7), np.zeros(7)), LABEL, Time(), 0.02)
    for name, value in changes.items():
        target = message if name in ("joint_names", "points") else message.points[0]
        setattr(target, name, value)
    return message


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (command(joint_names=list(JOINT_NAMES[:6])), "joint right_j6 missing"),
        (command(points=[]), "0 points"),
        (command(positions=[0.0] * 6), "joint values missing"),
        (
            command(positions=[float(POSITION_UPPER_RAD[0]) + 0.01] + [0.0] * 6),
            "joint right_j0 .* beyond its limits",
        ),
        (command(velocities=[0.0] * 6 + [-4.6]), "joint right_j6 .* beyond its limits"),
        (command(velocities=[0.0] * 3 + [np.nan] + [0.0] * 3), "joint right_j3 .* beyond its limits"),
        (command(positions=[0.0] * 5 + [-np.inf, 0.0]), "joint right_j5 .* beyond its limits"),
        (
            command_to_message(ROBOT, JointReference(np.zeros(7), np.zeros(7)), None, Time(), 0.0),
            "time_from_start is 0 s",
        ),
    ],
)
def test_commands_that_cannot_be_obeyed_are_refused_by_joint(message: Any, words: str) -> None:
    with pytest.raises(UserError, match=f"topic joint_command: .*{words}"):
        command_from_message(ROBOT, message)


def test_feeds_and_gestures_in_another_frame_or_without_numbers_are_refused() -> None:
    elsewhere = feed_to_message(Feeder().nominal(Side.FOREHAND))
    elsewhere.header.frame_id = "camera"
    with pytest.raises(UserError, match="topic feed: frame 'camera' is unknown"):
        feed_from_message(elsewhere)
    nowhere = feed_to_message(Feeder().nominal(Side.FOREHAND))
    nowhere.twist.twist.angular.y = np.nan
    with pytest.raises(UserError, match=r"topic feed: .* is not finite"):
        feed_from_message(nowhere)
    hand = gesture_to_message(HandGesture.now(np.zeros(3), [0.0, 0.0, 0.0, 1.0]), Time())
    hand.joint_names = ["elbow"]
    with pytest.raises(UserError, match=r"topic teach/hand: .*\['elbow'\]"):
        gesture_from_message(hand)


def test_an_outcome_without_its_status_is_refused() -> None:
    with pytest.raises(UserError, match="topic rally/outcome: no status named 'rally'"):
        read_outcome(DiagnosticArray())
