"""Messages of the table: feeds, outcomes and arrays as ROS carries them."""

from __future__ import annotations

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from std_msgs.msg import Header, MultiArrayDimension, UInt8MultiArray

from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import StrategyLabel
from msrd_ros.facts.outcome import Outcome
from msrd_ros.nodes.common import status
from msrd_ros.table_tennis.feeder import Feed

WORLD = "world"
RALLY = "rally"


def feed_to_message(feed: Feed, stamp: Any = None) -> Odometry:
    """One launch as nav_msgs/Odometry; velocity and spin are given in the frame `world`, too."""
    message = Odometry(child_frame_id=WORLD)
    message.header.frame_id = WORLD
    if stamp is not None:
        message.header.stamp = stamp
    point, twist = message.pose.pose.position, message.twist.twist
    point.x, point.y, point.z = feed.position
    twist.linear.x, twist.linear.y, twist.linear.z = feed.velocity
    twist.angular.x, twist.angular.y, twist.angular.z = feed.spin
    return message


def feed_from_message(message: Odometry) -> Feed:
    """Read one launch.

    Raises
    ------
    UserError
        If it is in another frame, or a number in it is not finite.
    """
    for frame in (message.header.frame_id, message.child_frame_id):
        if frame not in (WORLD, ""):
            raise UserError(f"topic feed: frame {frame!r} is unknown; give the launch in frame {WORLD!r}")
    point, twist = message.pose.pose.position, message.twist.twist
    state = np.array(
        [getattr(vector, axis) for vector in (point, twist.linear, twist.angular) for axis in "xyz"]
    )
    if not np.isfinite(state).all():
        raise UserError(f"topic feed: {state.tolist()} is not finite; give position, velocity and spin in SI")
    return Feed.from_state(state)


def outcome_to_message(outcome: Outcome, label: StrategyLabel | None, stamp: Any) -> DiagnosticArray:
    """A referee's decision as one status named `rally`, the label in the header."""
    message = DiagnosticArray(status=[status(RALLY, outcome.message, outcome.to_values())])
    message.header.stamp = stamp
    message.header.frame_id = str(label or "")
    return message


def outcome_from_message(message: Any) -> tuple[StrategyLabel | None, Outcome]:
    """Read a referee's decision and the strategy that was played.

    Raises
    ------
    UserError
        If the label or the status is not as `outcome_to_message` writes it.
    """
    where = "topic rally/outcome"
    text = message.header.frame_id
    label = StrategyLabel.parse(text, where) if text else None
    for item in message.status:
        if item.name == RALLY:
            values = {pair.key: pair.value for pair in item.values}
            return label, Outcome.from_values(item.message, values, where)
    raise UserError(f"{where}: no status named {RALLY!r}; publish the referee's decision under that name")


def bytes_to_message(data: bytes) -> UInt8MultiArray:
    """Safetensors bytes as std_msgs/UInt8MultiArray."""
    message = UInt8MultiArray(data=data)
    message.layout.dim = [MultiArrayDimension(label="safetensors", size=len(data), stride=len(data))]
    return message


def strategy_message(label: StrategyLabel | None, stamp: Any) -> Header:
    """The strategy wanted next, or none."""
    return Header(stamp=stamp, frame_id=str(label or ""))
