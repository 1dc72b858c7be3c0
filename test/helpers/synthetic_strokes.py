"""Strokes made up for tests: smooth joint motion and a ball that flies to the robot and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrd_ros.bags.schemas import serialise, typestore
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.contract.topics import CONTRACT, BagMessage, BagTopic
from sawyer import JOINT_NAMES, SPEED_LIMIT_RAD_S

START_NS = 1_700_000_000_000_000_000
LAUNCH_S = 0.3
RALLY_S = 1.95
URDF = (
    '<robot name="sawyer"><link name="world"/><link name="base"/><link name="paddle"/>'
    '<joint name="pedestal" type="fixed"><parent link="world"/><child link="base"/>'
    '<origin xyz="-2.0 0.1 0.9" rpy="0.1 0.2 0.3"/></joint>'
    '<joint name="hand" type="fixed"><parent link="base"/><child link="paddle"/></joint></robot>'
)


def make(type_name: str, *fields: Any) -> Any:
    """A message from its fields in order."""
    return typestore().types[type_name](*fields)


def header(time_ns: int, frame_id: str) -> Any:
    """A std_msgs/Header."""
    return make("std_msgs/msg/Header", make("builtin_interfaces/msg/Time", *divmod(time_ns, 10**9)), frame_id)


def joint_state(time_ns: int, frame_id: str, velocity_scale: float = 0.5, names: Any = None) -> bytes:
    """All seven joints swing; each peaks at `velocity_scale` of its speed limit once a second."""
    phase = 2 * np.pi * (time_ns % 10**9) / 1e9
    velocity = velocity_scale * SPEED_LIMIT_RAD_S * np.cos(phase)
    position = velocity_scale * SPEED_LIMIT_RAD_S * np.sin(phase) / (2 * np.pi)
    message = make(
        "sensor_msgs/msg/JointState",
        header(time_ns, frame_id),
        list(names or JOINT_NAMES),
        position,
        velocity,
        7.0 * position - velocity,
    )
    return serialise(message, "sensor_msgs/msg/JointState")


def ball_at(since_launch_s: float) -> tuple[float, float, float]:
    """At rest at the feeder, then to the robot at 4 m/s, and back from 0.6 s on."""
    t = max(since_launch_s, 0.0)
    x = 1.6 - 4.0 * t if t < 0.6 else -0.8 + 4.0 * (t - 0.6)
    return x, 0.1 * np.sin(t), 1.0 + 0.3 * np.cos(3.0 * t)


def ball_position(time_ns: int, since_launch_s: float) -> bytes:
    """A geometry_msgs/PointStamped."""
    point = make("geometry_msgs/msg/Point", *map(float, ball_at(since_launch_s)))
    message = make("geometry_msgs/msg/PointStamped", header(time_ns, "world"), point)
    return serialise(message, "geometry_msgs/msg/PointStamped")


def strategy(time_ns: int, label: str) -> bytes:
    """A bare std_msgs/Header."""
    return serialise(header(time_ns, label), "std_msgs/msg/Header")


def feed(time_ns: int) -> bytes:
    """A nav_msgs/Odometry with the launch."""
    types = "geometry_msgs/msg/"
    pose = make(
        f"{types}PoseWithCovariance",
        make(f"{types}Pose", make(f"{types}Point", 1.6, 0.0, 1.3), make(f"{types}Quaternion", 0, 0, 0, 1)),
        np.zeros(36),
    )
    twist = make(
        f"{types}TwistWithCovariance",
        make(f"{types}Twist", make(f"{types}Vector3", -4.0, 0.0, 0.0), make(f"{types}Vector3", 0, 0, 0)),
        np.zeros(36),
    )
    message = make("nav_msgs/msg/Odometry", header(time_ns, "world"), "ball", pose, twist)
    return serialise(message, "nav_msgs/msg/Odometry")


def outcome(time_ns: int, label: str, ball_id: int = 1, miss: MissReason | None = None) -> bytes:
    """A `rally/outcome` as the referee writes it."""
    result = Outcome(
        ball_id, struck=True, miss_reason=miss, hit_time_s=0.6, decision_time_s=RALLY_S, spin_y_rad_s=12.5
    )
    values = [make("diagnostic_msgs/msg/KeyValue", key, text) for key, text in result.to_values().items()]
    status = make("diagnostic_msgs/msg/DiagnosticStatus", 0, "rally", result.message, "", values)
    message = make("diagnostic_msgs/msg/DiagnosticArray", header(time_ns, label), [status])
    return serialise(message, "diagnostic_msgs/msg/DiagnosticArray")


def stroke_messages(
    label: str = "forehand-push",
    start_ns: int = START_NS,
    joint_hz: float = 250.0,
    ball_hz: float = 200.0,
    ball_id: int = 1,
    miss: MissReason | None = None,
    joint_frame: str | None = None,
    velocity_scale: float = 0.5,
) -> list[BagMessage]:
    """One ball on the contract's relative topics, in the order of sending.

    Parameters
    ----------
    joint_frame
        Frame of the joint states; the label from the launch to the outcome when None.
    velocity_scale
        Peak joint speed as a fraction of the limit.
    """
    launch_ns = start_ns + int(LAUNCH_S * 1e9)
    end_ns = launch_ns + int(RALLY_S * 1e9)
    rows: list[tuple[int, str, bytes]] = [
        (start_ns, "strategy", strategy(start_ns, label)),
        (launch_ns, "feed", feed(launch_ns)),
        (end_ns, "rally/outcome", outcome(end_ns, label, ball_id, miss)),
    ]
    for time_ns in range(start_ns, end_ns + 1, round(1e9 / joint_hz)):
        frame = (label if time_ns >= launch_ns else "") if joint_frame is None else joint_frame
        rows.append((time_ns, "joint_states", joint_state(time_ns, frame, velocity_scale)))
    rows += [
        (time_ns, "ball/position", ball_position(time_ns, (time_ns - launch_ns) / 1e9))
        for time_ns in range(start_ns, end_ns + 1, round(1e9 / ball_hz))
    ]
    # The decision is sent after the tick's states.
    rows.sort(key=lambda row: (row[0], row[1] == "rally/outcome"))
    return [BagMessage(topic, data, time, time, index) for index, (time, topic, data) in enumerate(rows)]


def described(start_ns: int = START_NS) -> BagMessage:
    """The robot description, latched."""
    data = serialise(make("std_msgs/msg/String", URDF), "std_msgs/msg/String")
    return BagMessage("robot_description", data, start_ns, start_ns)


def at_root(messages: list[BagMessage], prefix: str = "") -> list[BagMessage]:
    """The same messages on full topic names, in a namespace if wanted."""
    return [message._replace(topic=f"{prefix}/{message.topic.lstrip('/')}") for message in messages]


def topics_of(messages: list[BagMessage], prefix: str = "") -> list[BagTopic]:
    """The topics of messages on relative names, by full names."""
    names = dict.fromkeys(message.topic for message in messages)
    return [
        BagTopic(
            f"{prefix}/{name.lstrip('/')}",
            CONTRACT[name].type_name,
            latched=CONTRACT[name].latched,
            depth=CONTRACT[name].depth,
        )
        for name in names
    ]
