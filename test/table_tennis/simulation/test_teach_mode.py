"""Teach mode: the hand leads, the arm gives way, brakes and holds still."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.quintic import JointStroke
from msrd_ros.robots.rotations import turn_between
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.teachers.impedance_guidance import leading_hand
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import ARM, ROBOT

pytestmark = pytest.mark.slow

TICK_S = 0.004
PLAYING_POSTURE = np.array([0.0, 0.3, -1.2, 0.5, -0.5, 1.5, 0.0])


@pytest.fixture
def rally() -> Iterator[Rally]:
    with Rally() as one:
        one.reset(PLAYING_POSTURE)
        one.set_teach(True)
        yield one


@pytest.fixture(scope="module")
def strokes() -> dict[PaperLabel, JointStroke]:
    return planned_strokes()


def _lead_through(rally: Rally, stroke: JointStroke, skill: float) -> tuple[float, float]:
    """Lead the paddle through a stroke, streamed; returns how far off (m, rad) the paddle was at the hit."""
    grip = GuidanceConfig()
    rally.set_teach(False)
    rally.reset(stroke.start.position)
    rally.set_teach(True)
    began, off = rally.time, (np.inf, np.inf)
    while rally.time - began < stroke.end_time_s:
        state = stroke.at(rally.time - began)
        position, quaternion, twist = leading_hand(
            ARM,
            *state,
            np.array(ROBOT.floating.joint_damping_nm_s),
            grip.stiffness_n_m,
            grip.turn_stiffness_nm,
            skill,
            np.zeros(6),
            np.zeros(6),
        )
        rally.lead_hand(position, quaternion, twist[:3], twist[3:])
        rally.advance(TICK_S)
        if abs(rally.time - began - stroke.hit_time_s) <= TICK_S / 2:
            wanted, rotation = paddle_pose(ARM, stroke.at(rally.time - began).position)
            turn = turn_between(rally.paddle.rotation, rotation)
            off = float(np.linalg.norm(rally.paddle.position - wanted)), float(np.linalg.norm(turn))
    return off


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_a_skilled_hand_leads_strokes_closely_and_any_hand_within_the_speed_limits(
    rally: Rally, strokes: dict[PaperLabel, JointStroke], label: PaperLabel
) -> None:
    distance, turn = _lead_through(rally, strokes[label], skill=1.0)
    assert distance < 0.01
    assert turn < np.radians(3.0)
    slack, _ = _lead_through(rally, strokes[label], skill=0.0)
    assert distance < slack < 0.1
    assert rally.limits.limits_exceeded == 0


def test_the_paddle_follows_a_hand_around_a_circle(rally: Rally) -> None:
    start = rally.paddle
    turns, radius, frequency = 2.0, 0.08, 0.8
    times = np.arange(0.0, turns / frequency, 0.01)
    angle = 2.0 * np.pi * frequency * times
    fade = np.minimum(times / 0.4, 1.0)
    path = start.position + (fade * radius)[:, None] * np.stack(
        [np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=1
    )
    gesture = HandGesture(
        times,
        path,
        np.tile(start.quaternion, (len(times), 1)),
        np.gradient(path, times, axis=0),
        np.zeros((len(times), 3)),
    )
    rally.lead_gesture(gesture)
    errors = []
    for wanted in path[1:]:
        rally.advance(0.01)
        errors.append(np.sum((rally.paddle.position - wanted) ** 2))
    assert np.sqrt(np.mean(errors)) < 0.013
    # Afterwards the hand keeps the paddle where the gesture ended.
    rally.advance(1.0)
    assert np.linalg.norm(rally.paddle.position - path[-1]) < 0.002


def test_a_gesture_and_the_same_hand_streamed_agree(rally: Rally) -> None:
    start = rally.paddle
    times = np.arange(0.0, 0.6, TICK_S)
    speed = 0.3 * np.sin(np.pi * times / 0.6) ** 2
    path = np.tile(start.position, (len(times), 1))
    path[1:, 2] += np.cumsum(0.5 * (speed[1:] + speed[:-1])) * TICK_S
    velocity = np.zeros((len(times), 3))
    velocity[:, 2] = speed
    still = np.zeros((len(times), 3))
    turn = np.tile(start.quaternion, (len(times), 1))
    rally.lead_gesture(HandGesture(times, path, turn, velocity, still))
    rally.advance(times[-1])
    whole = rally.joint_position
    rally.set_teach(False)
    rally.reset(PLAYING_POSTURE)
    rally.set_teach(True)
    for index in range(len(times) - 1):
        rally.lead_hand(path[index], turn[index], velocity[index])
        rally.advance(TICK_S)
    np.testing.assert_allclose(rally.joint_position, whole, atol=2e-3)


def test_without_a_hand_the_arm_holds_still(rally: Rally) -> None:
    rally.advance(2.0)
    np.testing.assert_array_equal(rally.joint_position, PLAYING_POSTURE)


@pytest.mark.parametrize("mass_scale", [1.0, 1.1])
def test_let_go_in_motion_the_arm_comes_to_rest_and_stays(mass_scale: float) -> None:
    with Rally(RallyConfig(arm=ArmConfig(mass_scale=mass_scale))) as rally:
        rally.reset(PLAYING_POSTURE)
        rally.set_teach(True)
        paddle = rally.paddle
        for step in range(50):
            ahead = np.array([0.0, 0.0, 0.5 * step * TICK_S])
            rally.lead_hand(paddle.position + ahead, paddle.quaternion, (0.0, 0.0, 0.5))
            rally.advance(TICK_S)
        assert np.linalg.norm(rally.joint_velocity) > 0.3
        rally.release_hand()
        before = rally.paddle.position
        rally.advance(1.5)
        assert np.linalg.norm(rally.paddle.position - before) < 0.12
        stopped = rally.joint_position
        rally.advance(1.0)
        np.testing.assert_array_equal(rally.joint_position, stopped)


def test_a_streamed_hand_that_falls_silent_has_let_go(rally: Rally) -> None:
    paddle = rally.paddle
    rally.lead_hand(paddle.position, paddle.quaternion, (0.0, 0.0, 0.5))
    rally.advance(0.05)
    assert rally.joint_velocity.any()
    rally.advance(1.5)
    assert rally.at_rest
    assert np.linalg.norm(rally.paddle.position - paddle.position) < 0.15


@pytest.mark.parametrize("seed", range(4))
def test_a_hand_that_jerks_cannot_drive_a_joint_over_its_speed_limit(rally: Rally, seed: int) -> None:
    rng = np.random.default_rng(seed)
    paddle = rally.paddle
    for _ in range(40):
        turn = rng.normal(size=4) * 0.3 + paddle.quaternion
        jump = paddle.position + rng.normal(size=3) * 0.12 + np.array([0.0, 0.0, 0.1])
        for _ in range(10):
            rally.lead_hand(jump, turn)
            rally.advance(TICK_S)
    assert rally.limits.speed_fraction.max() > 0.85
    assert rally.limits.speed_exceeded == 0
    assert rally.limits.torque_exceeded == 0
    assert np.isfinite(rally.joint_position).all()


def test_a_hand_that_presses_into_the_table_does_not_get_through(rally: Rally) -> None:
    rally.set_teach(False)
    rally.reset(np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
    rally.set_teach(True)
    paddle = rally.paddle
    for step in range(500):
        below = paddle.position - np.array([0.0, 0.0, min(0.3 * step * TICK_S, 0.5)])
        rally.lead_hand(below, paddle.quaternion)
        rally.advance(TICK_S)
    assert paddle.position[2] > rally.paddle.position[2] > 0.76
    assert np.abs(rally.joint_velocity).max() < 0.5
    assert rally.limits.torque_exceeded == 0


def test_commands_are_ignored_while_teaching_and_followed_afterwards(rally: Rally) -> None:
    goal = PLAYING_POSTURE + 0.1
    rally.command(goal, np.zeros(7), 0.5)
    rally.advance(0.5)
    np.testing.assert_array_equal(rally.joint_position, PLAYING_POSTURE)
    rally.set_teach(False)
    rally.command(goal, np.zeros(7), 0.5)
    rally.advance(0.6)
    np.testing.assert_allclose(rally.joint_position, goal, atol=1e-6)


def test_leaving_teach_mode_in_motion_decelerates_to_a_hold(rally: Rally) -> None:
    paddle = rally.paddle
    for step in range(40):
        ahead = np.array([0.0, 0.0, 0.6 * step * TICK_S])
        rally.lead_hand(paddle.position + ahead, paddle.quaternion, (0.0, 0.0, 0.6))
        rally.advance(TICK_S)
    assert np.abs(rally.joint_velocity).max() > 0.2
    rally.set_teach(False)
    rally.advance(0.5)
    assert rally.at_rest
    assert rally.limits.limits_exceeded == 0


def test_bad_hands_are_refused(rally: Rally) -> None:
    paddle = rally.paddle
    with pytest.raises(UserError, match="positions"):
        rally.lead_hand((np.nan, 0.0, 1.0), paddle.quaternion)
    with pytest.raises(UserError, match="quaternions"):
        rally.lead_hand(paddle.position, (0.0, 0.0, 0.0, 0.0))
    rows = [np.zeros((2, width)) for width in (3, 4, 3, 3)]
    with pytest.raises(UserError, match="times"):
        HandGesture(np.array([0.1, 0.1]), *rows)
    with pytest.raises(UserError, match="shape"):
        HandGesture(np.array([0.0, 0.1, 0.2]), *rows)
    rally.set_teach(False)
    with pytest.raises(UserError, match="teach mode"):
        rally.lead_hand(paddle.position, paddle.quaternion)
