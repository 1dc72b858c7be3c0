"""Strokes made up for tests: smooth joint motion and a ball that flies to the robot and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.schemas import serialise, typestore
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.contract.topics import CONTRACT, BagMessage, BagTopic
from msrd_ros.recordings.paddle import paddle_poses
from sawyer import JOINT_NAMES, ROBOT, SPEED_LIMIT_RAD_S

START_NS = 1_700_000_000_000_000_000
LAUNCH_S = 0.3
RALLY_S = 1.95
HIT_S = 0.6
FEEDER = (1.6, 0.0, 1.3)
MIDDLE = np.array([-1.5, 0.0, 1.0])
"""Where a ball is struck if nobody says where the paddle is."""
SCALE = 0.5
"""Peak speed of the first joint over its limit."""
POSTURE_RAD = np.array([0.0, -0.3, -0.1, 0.9, -1.6, 1.6, -0.8])
SWING_RAD_S = SPEED_LIMIT_RAD_S * np.array([1.0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
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


def joint_position(time_ns: int, velocity_scale: float = SCALE) -> NDArray[np.float64]:
    """Angles of the seven joints, (7,): they swing once a second, about a posture that faces the ball."""
    phase = 2 * np.pi * (time_ns % 10**9) / 1e9
    return np.asarray(POSTURE_RAD + velocity_scale * SWING_RAD_S * np.sin(phase) / (2 * np.pi))


def joint_state(time_ns: int, frame_id: str, velocity_scale: float = SCALE, names: Any = None) -> bytes:
    """The first joint's speed peaks at `velocity_scale` of its limit once a second, the others' at less."""
    phase = 2 * np.pi * (time_ns % 10**9) / 1e9
    velocity = velocity_scale * SWING_RAD_S * np.cos(phase)
    position = joint_position(time_ns, velocity_scale)[: len(names or JOINT_NAMES)]
    velocity = velocity[: len(position)]
    message = make(
        "sensor_msgs/msg/JointState",
        header(time_ns, frame_id),
        list(names or JOINT_NAMES),
        position,
        velocity,
        7.0 * position - velocity,
    )
    return serialise(message, "sensor_msgs/msg/JointState")


def ball_at(since_launch_s: float, struck_at: NDArray[np.float64] = MIDDLE) -> NDArray[np.float64]:
    """At rest at the feeder, off the table to the paddle, struck there, and off the far half."""
    legs = [
        (0.4, np.array(FEEDER), np.array([-0.6, 0.0, 0.78])),
        (HIT_S - 0.4, np.array([-0.6, 0.0, 0.78]), struck_at),
        (0.5, struck_at, np.array([0.8, 0.1, 0.78])),
        (0.9, np.array([0.8, 0.1, 0.78]), np.array([2.6, 0.1, 0.2])),
    ]
    left_s = max(since_launch_s, 0.0)
    for length_s, begin, end in legs:
        if left_s <= length_s or end[0] > 2.0:
            fall = 0.5 * 9.81 * left_s * (length_s - left_s)
            return np.asarray(begin + (end - begin) * left_s / length_s + np.array([0.0, 0.0, fall]))
        left_s -= length_s
    raise AssertionError("the last leg has no end")


def ball_position(time_ns: int, since_launch_s: float, struck_at: NDArray[np.float64] = MIDDLE) -> bytes:
    """A geometry_msgs/PointStamped."""
    point = make("geometry_msgs/msg/Point", *map(float, ball_at(since_launch_s, struck_at)))
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
        make(f"{types}Pose", make(f"{types}Point", *FEEDER), make(f"{types}Quaternion", 0, 0, 0, 1)),
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
    velocity_scale: float = SCALE,
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
    at_hit = joint_position(launch_ns + int(HIT_S * 1e9), velocity_scale)
    (struck_at,) = paddle_poses(ROBOT, at_hit[None]).place
    rows += [
        (time_ns, "ball/position", ball_position(time_ns, (time_ns - launch_ns) / 1e9, struck_at))
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
