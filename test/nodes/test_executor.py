"""The executor as a process against a made-up robot: what it plays, refuses, and when it stops."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, UInt8MultiArray
from trajectory_msgs.msg import JointTrajectory

from live_executor import require_safe
from made_up_policies import made_up_policies
from msrd_ros.contract.episode import CONTROL_PERIOD_S, HORIZON
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.nodes.common import COMMAND, LATCHED, STATE
from msrd_ros.nodes.messages import bytes_to_message, command_from_message
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.ball_filter import BallFilter
from msrd_ros.table_tennis.strokes.player import StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies
from processes import RunningProcess
from sawyer import (
    HOME_POSTURE_RAD,
    JOINT_COUNT,
    JOINT_NAMES,
    ROBOT,
    SPEED_LIMIT_RAD_S,
)
from stack import Stack, one_line

pytestmark = pytest.mark.processes

LABELS = ALL_LABELS[:2]
ASK_AGAIN_S = 0.5
PERIOD_NS = round(CONTROL_PERIOD_S * 1e9)
RESTING = np.array([1.5, 0.0, 1.06])
POLICIES = made_up_policies(LABELS)


class Robot:
    """Publishes ticks and follows the answers to the letter."""

    def __init__(self, stack: Stack, profile: QoSProfile = STATE) -> None:
        self.stack = stack
        self.time_ns = 10**9
        self.position = HOME_POSTURE_RAD.copy()
        self.answers: list[JointTrajectory] = []
        node = stack.node
        self._states = node.create_publisher(JointState, "joint_states", profile)
        self._ball = node.create_publisher(PointStamped, "ball/position", profile)
        self._strategy = node.create_publisher(Header, "strategy", LATCHED)
        self.policy = node.create_publisher(UInt8MultiArray, "policy", LATCHED)
        node.create_subscription(JointTrajectory, "joint_command", self.answers.append, COMMAND)
        for publisher in (self._states, self._ball, self._strategy):
            stack.wait_until(publisher.get_subscription_count, publisher.topic_name)
        stack.wait_until(lambda: node.count_publishers("joint_command"), "joint_command")

    def ask(self, label: object) -> None:
        self._strategy.publish(Header(frame_id=str(label)))

    def send_policies(self, data: bytes) -> None:
        self.policy.publish(bytes_to_message(data))

    def send(self, ball: np.ndarray = RESTING, ball_age_ns: int = 0, state: JointState | None = None) -> None:
        """Publish one tick."""
        sample = PointStamped()
        sample.header.stamp = Time(nanoseconds=self.time_ns - ball_age_ns).to_msg()
        sample.point.x, sample.point.y, sample.point.z = map(float, ball)
        state = state or JointState(
            name=list(JOINT_NAMES), position=self.position.tolist(), velocity=[0.0] * 7, effort=[0.0] * 7
        )
        state.header.stamp = Time(nanoseconds=self.time_ns).to_msg()
        self._ball.publish(sample)
        self._states.publish(state)

    def tick(
        self, ball: np.ndarray = RESTING, ball_age_ns: int = 0, state: JointState | None = None
    ) -> tuple[np.ndarray, np.ndarray, str]:
        """One tick and its answer: position, velocity, label."""
        self.time_ns += PERIOD_NS
        self.answers.clear()
        asked_s = -1.0

        def answered() -> bool:
            nonlocal asked_s
            if time.monotonic() - asked_s > ASK_AGAIN_S:
                asked_s = time.monotonic()
                self.send(ball, ball_age_ns, state)
            return bool(self.answers) and stamp_to_ns(self.answers[-1].header.stamp) == self.time_ns

        self.stack.wait_until(answered, "answer")
        command = command_from_message(ROBOT, self.answers[-1])
        assert command.period_s == CONTROL_PERIOD_S
        self.position = command.position
        return command.position, command.velocity, str(command.label or "")

    def make_ready(self, label: object, pose: np.ndarray) -> None:
        """Tick until the arm rests in a pose and serves a strategy."""
        for _ in range(500):
            position, velocity, served = self.tick()
            if served == str(label) and np.array_equal(position, pose) and not velocity.any():
                return
        raise AssertionError(f"not ready for {label}")


def flying(step: int) -> np.ndarray:
    """The ball, `step` ticks after its launch."""
    position: np.ndarray = RESTING + np.array([-0.1 * step, 0.002 * step, 0.01 * step])
    return position


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("policies") / "policies.safetensors"
    path.write_bytes(POLICIES.to_bytes())
    return path


@pytest.fixture(scope="module")
def executor(shared_stack: Stack, checkpoint: Path) -> RunningProcess:
    process = shared_stack.start("executor", checkpoint=checkpoint)
    process.wait_for_line(f"ready: lockstep, policies {POLICIES.digest}")
    return process


@pytest.fixture(scope="module")
def robot(shared_stack: Stack, executor: RunningProcess) -> Robot:
    one = Robot(shared_stack)
    shared_stack.wait_until(one.policy.get_subscription_count, "policy")
    return one


def expected_stroke(
    policies: StrokePolicies, label: object, ball_filter: BallFilter | None = None
) -> list[np.ndarray]:
    """The commanded positions of one stroke with the ball of `flying`, played in process."""
    pose = policies.facts[label].ready_pose  # type: ignore[index]
    player = StrokePlayer(ROBOT, pose)
    player.prepare(policies.play(label, StrokeDraws.of(0, 0, JOINT_COUNT)), pose)  # type: ignore[arg-type]
    commands = []
    for step in range(-2, HORIZON):
        ball, stamp_ns = flying(max(step, 0)), 10**9 + step * PERIOD_NS
        if ball_filter is not None:
            ball, stamp_ns = ball_filter.see(stamp_ns, stamp_ns, ball)
        reference = player.tick(player.reference.position, ball, stamp_ns)
        if step >= 0:
            commands.append(reference.position)
    return commands


def play(robot: Robot, during: Callable[[int], None] = lambda _: None) -> list[np.ndarray]:
    commands = []
    for step in range(HORIZON):
        during(step)
        commands.append(robot.tick(flying(step))[0])
    return commands


def test_the_arm_is_brought_to_the_ready_pose_and_plays_as_in_process(robot: Robot) -> None:
    label = LABELS[0]
    robot.ask(label)
    robot.make_ready(label, POLICIES.facts[label].ready_pose)
    np.testing.assert_array_equal(play(robot), expected_stroke(POLICIES, label))


def test_a_tick_that_comes_again_gets_the_same_answer(robot: Robot) -> None:
    robot.tick()
    (first,) = robot.answers
    robot.send()
    robot.stack.wait_until(lambda: len(robot.answers) == 2, "the answer again")
    assert robot.answers[1] == first


def test_joints_come_in_any_order_among_others(robot: Robot) -> None:
    before = robot.position
    names = ["head_pan", *reversed(JOINT_NAMES)]
    values = [9.0, *before[::-1].tolist()]
    state = JointState(name=names, position=values, velocity=[0.0] * 8)
    position, _, _ = robot.tick(state=state)
    assert np.all(np.abs(position - before) <= SPEED_LIMIT_RAD_S * CONTROL_PERIOD_S)


def test_joint_states_that_cannot_be_used_are_named_and_not_answered(
    robot: Robot, executor: RunningProcess
) -> None:
    robot.time_ns += PERIOD_NS
    robot.answers.clear()
    broken = robot.position.copy()
    broken[5] = np.nan
    robot.send(state=JointState(name=list(JOINT_NAMES), position=broken.tolist(), velocity=[0.0] * 7))
    executor.wait_for_line("topic joint_states: position of joint right_j5 is not finite; check the driver")
    lacking = JointState(name=list(JOINT_NAMES[1:]), position=[0.0] * 6, velocity=[0.0] * 6)

    def refused_by_name() -> bool:
        robot.time_ns += PERIOD_NS
        robot.send(state=lacking)
        return "are passed over: they lack right_j0" in executor.output

    robot.stack.wait_until(refused_by_name, "refusal")
    assert robot.answers == []
    robot.tick()


def test_strategies_that_cannot_be_played_are_refused_and_the_present_one_stays(
    robot: Robot, executor: RunningProcess
) -> None:
    label = LABELS[0]
    robot.ask(label)
    robot.make_ready(label, POLICIES.facts[label].ready_pose)
    robot.ask("Lob!")
    executor.wait_for_line("topic strategy: 'Lob!' is no strategy label")
    for unknown in ("my-lob", ALL_LABELS[4]):
        robot.ask(unknown)

        def refused(
            line: str = f"no policy for strategy {unknown}; the checkpoint has forehand-push",
        ) -> bool:
            assert robot.tick()[2] == str(label)
            return line in executor.output

        robot.stack.wait_until(refused, "refusal")


def test_policies_are_exchanged_between_strokes_only(robot: Robot) -> None:
    label = LABELS[1]
    robot.ask(label)
    robot.make_ready(label, POLICIES.facts[label].ready_pose)
    others = made_up_policies(LABELS, seed=1)

    def exchange(step: int) -> None:
        if step == 10:
            robot.send_policies(others.to_bytes())

    np.testing.assert_array_equal(play(robot, exchange), expected_stroke(POLICIES, label))
    robot.make_ready(label, others.facts[label].ready_pose)
    assert robot.stack.diagnosed("executor")["policies"] == others.digest
    played = play(robot)
    np.testing.assert_array_equal(played, expected_stroke(others, label))
    assert np.abs(np.subtract(played, expected_stroke(POLICIES, label))).max() > 0.01


def test_unusable_policies_are_refused_and_the_present_ones_stay(
    robot: Robot, executor: RunningProcess
) -> None:
    before = robot.stack.diagnosed("executor")["policies"]
    robot.send_policies(b"\x80\x04K\x01.")
    executor.wait_for_line("topic policy: not a checkpoint of msrd_ros; give one that the trainer wrote")
    refused = int(robot.stack.diagnosed("executor")["refused"])
    robot.policy.publish(UInt8MultiArray(data=POLICIES.to_bytes()))
    robot.stack.wait_until(
        lambda: int(robot.stack.diagnosed("executor")["refused"]) == refused + 1, "refusal"
    )
    robot.tick()
    assert robot.stack.diagnosed("executor")["policies"] == before


def test_disabled_it_holds_still(robot: Robot) -> None:
    label = LABELS[0]
    robot.ask(label)
    assert robot.stack.set("executor/enable", False).success
    held = robot.tick()[0]
    for _ in range(20):
        position, velocity, _ = robot.tick()
    assert not velocity.any()
    assert np.abs(position - held).max() < 0.05
    assert robot.stack.set("executor/enable", True).success
    robot.make_ready(label, POLICIES.facts[label].ready_pose)


def test_disabled_it_leaves_an_arm_at_rest_to_whoever_else_commands_it(robot: Robot) -> None:
    stack, label = robot.stack, LABELS[0]
    assert stack.set("executor/enable", False).success
    while robot.tick()[1].any():
        pass
    other = stack.node.create_publisher(JointTrajectory, "joint_command", COMMAND)
    robot.time_ns += PERIOD_NS

    def given_way() -> bool:
        robot.send()
        return stack.diagnosed("executor")["gives_way"] == "true"

    stack.wait_until(given_way, "way")
    robot.answers.clear()
    robot.time_ns += PERIOD_NS
    robot.send()
    refusal = stack.set("executor/enable", True)
    assert not refusal.success
    assert "commands the arm; wait until that is over" in refusal.message
    assert robot.answers == []
    # The other one has led the arm elsewhere: what follows leads on from there.
    robot.position = robot.position + 0.3
    moved = robot.position
    stack.node.destroy_publisher(other)
    position, velocity, _ = robot.tick()
    np.testing.assert_allclose(position, moved)
    assert not velocity.any()
    assert stack.set("executor/enable", True).success
    robot.make_ready(label, POLICIES.facts[label].ready_pose)


def test_policies_may_see_a_fit_of_the_flight_instead_of_samples(stack: Stack, checkpoint: Path) -> None:
    process = stack.start("executor", checkpoint=checkpoint, estimate_ball=True, camera_noise_m=0.003)
    process.wait_for_line("ready: lockstep")
    label, robot = LABELS[0], Robot(stack)
    robot.ask(label)
    robot.make_ready(label, POLICIES.facts[label].ready_pose)
    robot.tick()
    played = play(robot)
    expected = expected_stroke(POLICIES, label, BallFilter(0.003))
    np.testing.assert_allclose(played, expected, atol=1e-6)
    assert np.abs(np.subtract(expected, expected_stroke(POLICIES, label))).max() > 1e-4


def test_a_second_executor_ends_with_a_clear_line(
    shared_stack: Stack, robot: Robot, checkpoint: Path
) -> None:
    second = shared_stack.start("executor", checkpoint=checkpoint)
    line = one_line(second, "executor")
    assert "another node already commands /joint_command (" in line
    assert "stop it first, or start this executor in a namespace of its own" in line
    # The first plays on.
    robot.tick()


def test_in_real_time_the_arm_comes_to_rest_when_joint_states_fall_silent(
    stack: Stack, checkpoint: Path
) -> None:
    process = stack.start("executor", checkpoint=checkpoint, mode="real_time", accept_policy=False)
    process.wait_for_line("ready: real_time")
    robot = Robot(stack)
    robot.ask(LABELS[0])

    def is_fast() -> bool:
        time.sleep(CONTROL_PERIOD_S)
        robot.time_ns += PERIOD_NS
        if robot.answers:
            robot.position = np.array(robot.answers[-1].points[0].positions)
        robot.send()
        return bool(robot.answers) and np.abs(robot.answers[-1].points[0].velocities).max() > 0.3

    stack.wait_until(is_fast, "motion to the ready pose")
    # From now on there are none: what follows comes from the executor's own clock.
    stack.wait_until(lambda: not np.any(robot.answers[-1].points[0].velocities), "rest")
    require_safe(robot.answers, pauses=True)
    assert all(stamp_to_ns(answer.header.stamp) == 0 for answer in robot.answers)
    assert int(stack.diagnosed("executor")["stops"]) > 0


def test_a_best_effort_driver_is_heard(stack: Stack, checkpoint: Path) -> None:
    process = stack.start("executor", checkpoint=checkpoint)
    process.wait_for_line("ready: lockstep")
    robot = Robot(stack, qos_profile_sensor_data)
    robot.ask(LABELS[0])
    assert robot.tick()[2] in ("", str(LABELS[0]))
    robot.make_ready(LABELS[0], POLICIES.facts[LABELS[0]].ready_pose)
