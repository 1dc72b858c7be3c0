"""Faults of messages: rubbish on what an executor hears; ticks that are lost, late, doubled, exchanged."""

from __future__ import annotations

import copy
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, UInt8MultiArray
from trajectory_msgs.msg import JointTrajectory

from domains import reserved_domain
from faults.files import mutate_bytes
from faults.guard import Guard, wait_until
from faults.nodes import Play, play
from faults.trials import Finding, Setting, Trial
from made_up_policies import made_up_policies
from msrd_ros.contract.translation import ns_to_stamp
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.robots.loading import default_robot
from stack import Stack

Rng = np.random.Generator
PERIOD_S = 0.02
REST_S = 1.5
"""After so long without a good message the arm is at rest."""
_NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, -0.0, 57.3, 10.0, -10.0, 1e6)
_LABELS = (
    "",
    "forehand-push",
    "backhand-slice",
    "no-such",
    "../x",
    "a" * 500,
    "world",
    "\u00e4\n",
    "FOREHAND",
)


class FakeArm:
    """A driver and a camera in real time: the arm is where it was last told to be, balls come one by one."""

    def __init__(self, node: Node) -> None:
        self.robot = default_robot()
        self.position = self.robot.home_rad.copy()
        self.velocity = np.zeros(self.robot.joint_count)
        profile = QoSProfile(depth=1000)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.outputs = {
            "joint_states": node.create_publisher(JointState, "joint_states", profile),
            "ball/position": node.create_publisher(PointStamped, "ball/position", profile),
            "strategy": node.create_publisher(Header, "strategy", latched),
            "policy": node.create_publisher(UInt8MultiArray, "policy", latched),
            "feed": node.create_publisher(Odometry, "feed", profile),
        }
        node.create_subscription(JointTrajectory, "joint_command", self._obey, profile)
        self._good_policies = made_up_policies().to_bytes()

    def _obey(self, message: JointTrajectory) -> None:
        self.position = np.array(message.points[-1].positions)
        self.velocity = np.array(message.points[-1].velocities)

    def good(self, topic: str) -> Any:
        """What the driver, the camera or a person says now."""
        now_ns = time.time_ns()
        message: Any
        if topic == "joint_states":
            message = JointState(
                name=list(self.robot.joint_names),
                position=self.position.tolist(),
                velocity=self.velocity.tolist(),
                effort=[0.0] * self.robot.joint_count,
            )
            ns_to_stamp(now_ns, message.header.stamp)
        elif topic == "ball/position":
            since_s = (now_ns / 1e9) % 2.0
            message = PointStamped()
            message.header.frame_id = "world"
            point = message.point
            point.x, point.y, point.z = (
                1.4 - 3.0 * since_s,
                -0.2,
                1.1 + 2.0 * since_s - 4.9 * since_s**2 + 3.0,
            )
            ns_to_stamp(now_ns, message.header.stamp)
        elif topic == "strategy":
            message = Header(frame_id="forehand-push")
        elif topic == "policy":
            message = bytes_to_message(self._good_policies)
        else:
            message = Odometry(child_frame_id="world")
            message.header.frame_id = "world"
        return message


def _mutate_numbers(values: Any, rng: Rng) -> list[float]:
    numbers = list(values)
    match int(rng.integers(5)):
        case 0 if numbers:
            numbers[int(rng.integers(len(numbers)))] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
        case 1:
            numbers = numbers[: int(rng.integers(len(numbers) + 1))]
        case 2:
            numbers = numbers + numbers
        case 3:
            numbers = [math.degrees(number) for number in numbers]
        case _:
            rng.shuffle(numbers)
    return numbers


def _mutate_stamp(stamp: Any, rng: Rng) -> None:
    now_ns = time.time_ns()
    offsets = (0, -(10**9), 10**9, 3600 * 10**9, -3600 * 10**9, -now_ns, 2**61 - now_ns)
    ns_to_stamp(max(now_ns + offsets[int(rng.integers(len(offsets)))], 0), stamp)


def mutate_message(topic: str, message: Any, rng: Rng) -> Any:
    """A message as it should not be, though ROS can carry it."""
    message = copy.deepcopy(message)
    if topic == "joint_states":
        match int(rng.integers(6)):
            case 0:
                names = list(message.name)
                rng.shuffle(names)
                message.name = names
            case 1:
                message.name = list(message.name)[: int(rng.integers(len(message.name) + 1))]
            case 2:
                message.name = [*message.name[:-1], message.name[0]]
            case 3:
                _mutate_stamp(message.header.stamp, rng)
            case 4:
                message.velocity = _mutate_numbers(message.velocity, rng)
            case _:
                message.position = _mutate_numbers(message.position, rng)
    elif topic == "ball/position":
        if rng.random() < 0.4:
            _mutate_stamp(message.header.stamp, rng)
        elif rng.random() < 0.2:
            message.header.frame_id = _LABELS[int(rng.integers(len(_LABELS)))]
        else:
            setattr(message.point, "xyz"[int(rng.integers(3))], _NUMBERS[int(rng.integers(len(_NUMBERS)))])
    elif topic == "strategy":
        message.frame_id = _LABELS[int(rng.integers(len(_LABELS)))]
    elif topic == "policy":
        message = bytes_to_message(mutate_bytes(bytes(message.data), rng))
    else:
        vector = (message.pose.pose.position, message.twist.twist.linear)[int(rng.integers(2))]
        setattr(vector, "xyz"[int(rng.integers(3))], _NUMBERS[int(rng.integers(len(_NUMBERS)))])
    return message


def rubbish(setting: Setting) -> Finding:
    """In real time: a share of all messages to an executor is rubbish; then silence; then good ones again."""
    rng, finding = setting.rng("rubbish"), Finding()
    policies = setting.folder / "policies.safetensors"
    policies.write_bytes(made_up_policies().to_bytes())
    with reserved_domain() as domain, Stack(domain, setting.folder) as stack:
        arm = FakeArm(stack.node)
        guard = Guard(stack.node, arm.robot, finding)
        executor = stack.start("executor", checkpoint=policies, mode="real_time")
        whole = setting.count(100_000, least=1000)
        spin = lambda: stack.executor.spin_once(timeout_sec=0.0)  # noqa: E731

        def cycle(bad_share: float) -> None:
            for topic in ("ball/position", "joint_states"):
                arm.outputs[topic].publish(arm.good(topic))
            for _ in range(20):
                if rng.random() < bad_share:
                    topic = list(arm.outputs)[int(rng.choice(5, p=[0.5, 0.3, 0.1, 0.05, 0.05]))]
                    arm.outputs[topic].publish(mutate_message(topic, arm.good(topic), rng))
                    finding.tried += 1
            wait_until(spin, lambda: False, PERIOD_S)

        arm.outputs["strategy"].publish(arm.good("strategy"))
        found = wait_until(lambda: cycle(0.0), lambda: guard.commands > 50, 60.0)
        finding.require(found, f"no commands before the first rubbish: {executor.output[-300:]}")
        while finding.tried < whole and executor.running:
            for _ in range(100):
                cycle(1.0)
            # Silence: nothing may move on for long.
            wait_until(spin, lambda: False, REST_S)
            finding.require(guard.speed < 1e-3, f"still {guard.speed:.3g} rad/s after {REST_S} s of silence")
            arm.outputs["strategy"].publish(arm.good("strategy"))
            wanted = guard.commands + 50
            found = wait_until(lambda: cycle(0.0), lambda wanted=wanted: guard.commands >= wanted, 20.0)  # type: ignore[misc]
            finding.require(found, f"no commands after the rubbish: {executor.output[-300:]}")
        finding.require(executor.running, f"the executor ended: {executor.output[-400:]}")
        finding.figures["commands"] = guard.commands
    return finding


class Relay:
    """Hands on serialised messages from one topic to another: some not, some late, twice or out of order."""

    def __init__(
        self,
        node: Node,
        message_type: Any,
        source: str,
        target: str,
        rng: Rng,
        note: Callable[[], None],
    ) -> None:
        self._rng, self._harm, self._note = rng, 0.0, note
        profile = QoSProfile(depth=1000)
        self._output = node.create_publisher(message_type, target, profile)
        self._late: deque[tuple[float, bytes]] = deque()
        node.create_subscription(message_type, source, self._take, profile, raw=True)
        node.create_timer(0.005, self._send_late)

    def set_harm(self, harm: float) -> None:
        """What share of messages meets a fault from now on."""
        self._harm = harm

    def _take(self, data: bytes) -> None:
        if self._rng.random() >= self._harm:
            self._output.publish(data)
            return
        self._note()
        match int(self._rng.integers(3)):
            case 0:
                pass  # lost
            case 1:
                self._output.publish(data)
                self._output.publish(data)
            case _:
                # Late by up to .3 s: those that follow overtake it.
                self._late.append((time.monotonic() + float(self._rng.uniform(0.01, 0.3)), data))

    def _send_late(self) -> None:
        now_s = time.monotonic()
        for _ in range(len(self._late)):
            due_s, data = self._late.popleft()
            if due_s <= now_s:
                self._output.publish(data)
            else:
                self._late.append((due_s, data))


_RELAYED = ("joint_states", "ball/position", "joint_command")


def bad_line(setting: Setting) -> Finding:
    """In lockstep time, with a bad line between the simulator and everybody else."""
    rng, finding = setting.rng("bad line"), Finding()

    def note() -> None:
        finding.tried += 1

    def connect(scene: Play) -> list[Relay]:
        node = scene.stack.node
        types = {"joint_states": JointState, "ball/position": PointStamped, "joint_command": JointTrajectory}
        ends = {name: (f"far/{name}", name) for name in _RELAYED}
        ends["joint_command"] = ends["joint_command"][::-1]
        return [Relay(node, types[name], *ends[name], rng, note) for name in _RELAYED]

    remaps = tuple(f"{name}:=far/{name}" for name in _RELAYED)
    with play(setting, finding, connect=connect, remaps={"simulator": remaps}) as scene:
        for harm in (0.02, 0.1, 0.3)[: setting.count(3)]:
            for relay in scene.relays:
                relay.set_harm(harm)
            scene.spin_for(60.0 * min(setting.share * 5.0, 1.0))
            for relay in scene.relays:
                relay.set_harm(0.0)
            scene.require_play(f"a line that harms {harm:.0%} of the messages")
    return finding


def hot_swaps(setting: Setting) -> Finding:
    """Publish new policies again and again, far faster than strokes end."""
    finding = Finding()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    several = [bytes_to_message(made_up_policies(seed=seed).to_bytes()) for seed in range(5)]
    with play(setting, finding) as scene:
        output = scene.stack.node.create_publisher(UInt8MultiArray, "policy", latched)
        for number in range(setting.count(1000)):
            finding.tried += 1
            output.publish(several[number % len(several)])
            scene.spin_for(0.05)
        scene.require_play("the last policies")
        told = scene.stack.diagnosed("executor")
        finding.figures["adopted"] = int(told["swaps"])
        finding.require(
            int(told["refused"]) == 0, f"{told['refused']} refusals, though all policies were good"
        )
    return finding


TRIALS = (
    Trial(
        "rubbish",
        "NaN, Inf, huge, denormal, jumbled, half-empty messages and stamps, real time",
        "nothing beyond limits; at rest after silence; commands again afterwards",
        rubbish,
    ),
    Trial(
        "bad-line",
        "joint states, balls and commands lost, doubled, late and out of order, lockstep",
        "limits kept; play goes on once the line is good",
        bad_line,
    ),
    Trial("hot-swaps", "policies exchanged at 20 Hz", "limits kept; play goes on; none refused", hot_swaps),
)
