"""Thousands of messages, wrong in every way, on all that the executor hears: what it sends is safe."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import MultiArrayDimension, UInt8MultiArray

from live_executor import LiveExecutor, flying, live_executor, require_safe
from made_up_policies import made_up_policies
from msrd_ros.nodes.adaptive import Received
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from sawyer import JOINT_NAMES

LABELS = ALL_LABELS[:2]
POLICIES = made_up_policies(LABELS, gain=3.0).to_bytes()
VALUES = (0.0, -0.0, 1e-320, 1e-9, 0.3, 3.2, 57.3, -1e9, 1e308, np.inf, -np.inf, np.nan)
MESSAGES = 1500


def stamp(rng: np.random.Generator, arm: LiveExecutor) -> Any:
    """Mostly of now, else late, doubled, from the future, zero or anything."""
    choices = (0, 0, 0, -20_000_000, -200_000_000, 30_000_000, 3_600 * 10**9, -arm.stamp_ns, 2**62 // 10**9)
    time_ns = arm.stamp_ns + int(rng.choice(choices))
    return Time(nanoseconds=max(time_ns, 0)).to_msg()


def spoil(rng: np.random.Generator, values: list[float]) -> list[float]:
    """Change one value, some or the number of them."""
    kind = rng.integers(6)
    if kind == 0:
        values[rng.integers(len(values))] = float(rng.choice(VALUES))
    elif kind == 1:
        values = [float(rng.choice(VALUES)) for _ in values]
    elif kind == 2:
        values = values[: rng.integers(len(values))]
    elif kind == 3:
        values = [*values, *values]
    elif kind == 4:
        values = list(np.degrees(values))
    return values


def odd_joints(rng: np.random.Generator, arm: LiveExecutor) -> None:
    position = arm.position + (rng.random() < 0.3) * rng.normal(size=7)
    names = list(JOINT_NAMES)
    state = JointState(name=names, position=position.tolist(), velocity=[0.0] * 7, effort=[])
    kind = rng.integers(6)
    if kind == 0:
        state.position = spoil(rng, list(state.position))
    elif kind == 1:
        state.velocity = spoil(rng, list(state.velocity))
    elif kind == 2:
        state.name = list(rng.permutation(names))
    elif kind == 3:
        state.name = [str(name) for name in rng.choice([*names, "gripper", "", "\x00 "], rng.integers(12))]
    elif kind == 4:
        state = JointState()
    state.header.stamp = stamp(rng, arm)
    arm.joints(state, int(rng.choice([1, 2, 1000, 2**40])) if rng.random() < 0.1 else None)


def odd_ball(rng: np.random.Generator, arm: LiveExecutor) -> None:
    message = PointStamped()
    point = spoil(rng, [1.5, 0.0, 1.0, 0.0])[:3] + [0.0] * 3
    message.point.x, message.point.y, message.point.z = map(float, point[:3])
    message.header.stamp = stamp(rng, arm)
    arm.node._inputs._on_ball(Received(message, 0, 0, 0, 0))


def odd_policies(rng: np.random.Generator, arm: LiveExecutor) -> None:
    data = bytearray(POLICIES)
    length = int.from_bytes(data[:8], "little")
    kind = rng.integers(4)
    if kind == 0:
        for place in rng.integers(len(data), size=rng.integers(1, 5)):
            data[place] = rng.integers(256)
    elif kind == 1:
        del data[rng.integers(len(data)) :]
    else:
        header = json.loads(data[8 : 8 + length])
        content = json.loads(header["__metadata__"]["msrd_ros"])
        change_anything(rng, content)
        header["__metadata__"]["msrd_ros"] = json.dumps(content)
        text = json.dumps(header).encode()
        data = bytearray(len(text).to_bytes(8, "little") + text + data[8 + length :])
    message = UInt8MultiArray(data=bytes(data))
    label = str(rng.choice(["safetensors", "safetensors", "safetensors", "pickle"]))
    message.layout.dim = [MultiArrayDimension(label=label)] if rng.random() < 0.9 else []
    arm.node._on_policy(message)


def change_anything(rng: np.random.Generator, content: Any) -> None:
    """Put something else into one place of nested data."""
    while True:
        keys = list(content) if isinstance(content, dict) else list(range(len(content)))
        if not keys:
            return
        key = keys[rng.integers(len(keys))]
        child = content[key]
        if not isinstance(child, dict | list) or rng.random() < 0.2:
            break
        content = child
    numbers: tuple[Any, ...] = (-1, 1e999, float("nan"), True)
    values = (None, "text", [], {}, [0.1], [0.1] * 6, [0.1] * 8, [[0.0]], *numbers)
    content[key] = values[rng.integers(len(values))]


def odd_strategy(rng: np.random.Generator, arm: LiveExecutor) -> None:
    arm.strategy(rng.choice(["", "Lob!", "my-lob", "\x00", *map(str, LABELS), "x" * 10_000]))


def odd_wishes(rng: np.random.Generator, arm: LiveExecutor) -> None:
    arm.node.change("enabled", bool(rng.random() < 0.7))


ODD: tuple[Callable[[np.random.Generator, LiveExecutor], None], ...] = (
    odd_joints,
    odd_joints,
    odd_joints,
    odd_ball,
    odd_ball,
    odd_policies,
    odd_strategy,
    odd_wishes,
)


@pytest.mark.parametrize("estimate_ball", [False, True])
@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_whatever_is_heard_what_is_sent_is_safe(mode: str, estimate_ball: bool, domain_id: int) -> None:
    rng = np.random.default_rng(1)
    with live_executor(domain_id, mode=mode, estimate_ball=estimate_ball) as arm:
        arm.policies(POLICIES)
        arm.make_ready(LABELS[0])
        step = 0
        for _ in range(MESSAGES):
            if rng.random() < 0.3:
                ODD[rng.integers(len(ODD))](rng, arm)
            else:
                step = (step + 1) % 150
                arm.tick(flying(max(step - 50, 0)))
            if rng.random() < 0.01:
                arm.wait(float(rng.choice([0.1, 0.3, 1.0])))
            if rng.random() < 0.1:
                arm.follow()
        assert len(arm.commands) > MESSAGES // 10
        # The gate is the last resort: nothing on the way to it may lean on it.
        assert not [line for line in arm.said if "a command " in line]
        # In the end all is well again.
        arm.node.change("enabled", True)
        arm.wait(5.0)
        arm.follow()
        arm.policies(POLICIES)
        for _ in range(10):
            arm.tick()  # until the arm is known to rest where it is
        arm.make_ready(LABELS[1])
        arm.swing()
        require_safe(arm.commands, pauses=mode == "real_time")
