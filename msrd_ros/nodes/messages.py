"""Messages of the table: feeds, outcomes and arrays as ROS carries them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, Transform, Twist, Vector3
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, MultiArrayDimension, UInt8MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS, RALLY_STATUS
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import status
from msrd_ros.robots.command_gate import Waypoint, command_points
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.simulation.teach_mode import HandGesture
from msrd_ros.table_tennis.simulation.world import Tick
from msrd_ros.table_tennis.strokes.reach import require_on_table

WORLD = "world"
PADDLE = "paddle"


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


def to_stamp(time_ns: int) -> Any:
    """Nanoseconds as builtin_interfaces/Time."""
    return Time(nanoseconds=time_ns).to_msg()


def ball_of_tick(tick: Tick) -> PointStamped:
    """What is seen of the ball."""
    message = PointStamped()
    message.header.frame_id = WORLD
    message.header.stamp = to_stamp(tick.ball_stamp_ns)
    message.point.x, message.point.y, message.point.z = map(float, tick.ball_position)
    return message


def joints_of_tick(tick: Tick, robot: Robot) -> JointState:
    """State of an arm's joints, under the strategy of the ball in play."""
    message = JointState(
        name=list(robot.joint_names),
        position=tick.joint_position.tolist(),
        velocity=tick.joint_velocity.tolist(),
        effort=tick.joint_effort.tolist(),
    )
    message.header.stamp = to_stamp(tick.time_ns)
    message.header.frame_id = str(tick.label or "")
    return message


def target_to_message(target: NDArray[np.float64] | None, stamp: Any) -> PointStamped:
    """Where a ball is to land, (2,), m, on the table; None takes a target back."""
    message = PointStamped()
    message.header.stamp = stamp
    if target is not None:
        message.header.frame_id = WORLD
        message.point.x, message.point.y = map(float, target)
        message.point.z = Table().height_m
    return message


def target_from_message(message: PointStamped) -> NDArray[np.float64] | None:
    """Read where a ball is to land: (2,), m; None takes a target back. How high the point is does not count.

    Raises
    ------
    UserError
        If it is in another frame, not finite, or not on the far half of the table.
    """
    where, frame = "topic target", message.header.frame_id
    if not frame:
        return None
    if frame != WORLD:
        raise UserError(
            f"{where}: frame {frame!r} is unknown; give the point in frame {WORLD!r}, or no frame to take a "
            "target back"
        )
    target = np.array([message.point.x, message.point.y])
    require_on_table(target, where)
    return target


class Command(NamedTuple):
    """What a joint_command asks for: the state after one control period, and for which strategy."""

    label: StrategyLabel | None
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    period_s: float


def command_to_message(
    robot: Robot, reference: JointReference, label: StrategyLabel | None, stamp: Any, period_s: float
) -> JointTrajectory:
    """A state, reached `period_s` after `stamp`, and how the arm comes to rest if nothing follows."""
    return points_to_message(robot, command_points(robot, reference, period_s), label, stamp)


def points_to_message(
    robot: Robot, points: Sequence[Waypoint], label: StrategyLabel | None, stamp: Any
) -> JointTrajectory:
    """A command as ros2_control's joint_trajectory_controller takes it: rising times, at rest in the end."""
    message = JointTrajectory(joint_names=list(robot.joint_names))
    message.points = [
        JointTrajectoryPoint(
            positions=point.position.tolist(),
            velocities=point.velocity.tolist(),
            time_from_start=_duration(point.time_s),
        )
        for point in points
    ]
    message.header.stamp = stamp
    message.header.frame_id = str(label or "")
    return message


def command_from_message(robot: Robot, message: JointTrajectory) -> Command:
    """Read a joint_command for an arm: its first point; the others tell how it would come to rest.

    Raises
    ------
    UserError
        If a joint is missing, a number is not finite, or it is beyond a joint's limits; names the joint.
    """
    where = "topic joint_command"
    if not message.points:
        raise UserError(f"{where}: 0 points; send where the joints shall be after a control period")
    point = message.points[0]
    names = list(message.joint_names)
    missing = [joint for joint in robot.joint_names if joint not in names]
    if missing or not len(point.positions) == len(point.velocities) == len(names):
        raise UserError(
            f"{where}: joint {', '.join(missing) or 'values'} missing; send all joints of {robot.name}"
        )
    order = [names.index(joint) for joint in robot.joint_names]
    position, velocity = np.array(point.positions)[order], np.array(point.velocities)[order]
    period_s = point.time_from_start.sec + point.time_from_start.nanosec / NANOSECONDS
    # Written so that NaN fails, too.
    limits = robot.limits
    fits = (position >= limits.lower_rad) & (position <= limits.upper_rad)
    fits &= np.abs(velocity) <= limits.speed_rad_s * (1.0 + 1e-9)
    if not fits.all():
        joint = int(np.flatnonzero(~fits)[0])
        raise UserError(
            f"{where}: joint {robot.joint_names[joint]} is sent to {position[joint]:.4g} rad at "
            f"{velocity[joint]:.4g} rad/s, beyond its limits; the command is not obeyed"
        )
    if not 0.0 < period_s <= 1.0:
        raise UserError(f"{where}: time_from_start is {period_s:g} s; send the control period, at most 1 s")
    text = message.header.frame_id
    return Command(StrategyLabel.parse(text, where) if text else None, position, velocity, period_s)


def _duration(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Duration(sec=whole, nanosec=nanoseconds)


def gesture_to_message(gesture: HandGesture, stamp: Any) -> MultiDOFJointTrajectory:
    """Where the hand leads the paddle: one point is streamed, many are a whole gesture."""
    message = released_hand(stamp)
    for index, time_s in enumerate(gesture.times_s):
        linear, angular = gesture.velocities[index], gesture.angular_velocities[index]
        message.points.append(
            MultiDOFJointTrajectoryPoint(
                transforms=[transform(gesture.positions[index], gesture.quaternions[index])],
                velocities=[
                    Twist(
                        linear=Vector3(x=float(linear[0]), y=float(linear[1]), z=float(linear[2])),
                        angular=Vector3(x=float(angular[0]), y=float(angular[1]), z=float(angular[2])),
                    )
                ],
                time_from_start=_duration(float(time_s)),
            )
        )
    return message


def released_hand(stamp: Any) -> MultiDOFJointTrajectory:
    """No hand leads the paddle: the gesture under way ends by itself, and time goes on."""
    message = MultiDOFJointTrajectory(joint_names=[PADDLE])
    message.header.frame_id = WORLD
    message.header.stamp = stamp
    return message


def gesture_from_message(message: MultiDOFJointTrajectory) -> HandGesture | None:
    """Read where the hand leads the paddle; None (no points) lets the gesture under way go on.

    Raises
    ------
    UserError
        If it is in another frame, leads something else than the paddle, or a number is not finite.
    """
    where = "topic teach/hand"
    if message.header.frame_id != WORLD or list(message.joint_names) != [PADDLE]:
        raise UserError(
            f"{where}: frame {message.header.frame_id!r}, joints {list(message.joint_names)}; "
            f"lead the joint {PADDLE!r} in frame {WORLD!r}"
        )
    if not message.points:
        return None
    if any(len(point.transforms) != 1 or len(point.velocities) != 1 for point in message.points):
        raise UserError(f"{where}: give one transform and one velocity in every point")
    poses = [point.transforms[0] for point in message.points]
    twists = [point.velocities[0] for point in message.points]
    times = [point.time_from_start for point in message.points]
    return HandGesture(
        np.array([time.sec + time.nanosec / NANOSECONDS for time in times]),
        np.array([[getattr(pose.translation, axis) for axis in "xyz"] for pose in poses]),
        np.array([[getattr(pose.rotation, axis) for axis in "xyzw"] for pose in poses]),
        np.array([[getattr(twist.linear, axis) for axis in "xyz"] for twist in twists]),
        np.array([[getattr(twist.angular, axis) for axis in "xyz"] for twist in twists]),
    )


def transform(position: NDArray[np.float64], quaternion: NDArray[np.float64]) -> Transform:
    """Position (3,) in m and quaternion (x, y, z, w) as geometry_msgs/Transform."""
    value = Transform()
    value.translation.x, value.translation.y, value.translation.z = map(float, position)
    value.rotation.x, value.rotation.y, value.rotation.z, value.rotation.w = map(float, quaternion)
    return value


def outcome_to_message(outcome: Outcome, label: StrategyLabel | None, stamp: Any) -> DiagnosticArray:
    """A referee's decision as one status named `rally`, the label in the header."""
    message = DiagnosticArray(status=[status(RALLY_STATUS, outcome.message, outcome.to_values())])
    message.header.stamp = stamp
    message.header.frame_id = str(label or "")
    return message


def bytes_to_message(data: bytes) -> UInt8MultiArray:
    """Safetensors bytes as std_msgs/UInt8MultiArray."""
    message = UInt8MultiArray(data=data)
    message.layout.dim = [MultiArrayDimension(label="safetensors", size=len(data), stride=len(data))]
    return message


def strategy_message(label: StrategyLabel | None, stamp: Any) -> Header:
    """The strategy wanted next, or none."""
    return Header(stamp=stamp, frame_id=str(label or ""))
