"""Table, net, ball and the ball's path as markers, and the robot's frames as TF: what RViz shows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, TransformStamped
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from msrd_ros.nodes.messages import WORLD, transform
from msrd_ros.table_tennis.ball.scene import Scene

TABLE_BLUE = ColorRGBA(r=0.05, g=0.22, b=0.45, a=1.0)
NET_WHITE = ColorRGBA(r=0.9, g=0.9, b=0.9, a=0.6)
TARGET_GREEN = ColorRGBA(r=0.1, g=0.75, b=0.3, a=0.9)
TARGET_DIAMETER_M = 0.2
BALL_ORANGE = ColorRGBA(r=1.0, g=0.5, b=0.0, a=1.0)


def _marker(name: str, identity: int, kind: int, size: Iterable[float], colour: ColorRGBA) -> Marker:
    marker = Marker(ns=name, id=identity, type=kind, action=Marker.ADD, color=colour, frame_locked=False)
    marker.header.frame_id = WORLD
    marker.scale.x, marker.scale.y, marker.scale.z = map(float, size)
    marker.pose.orientation.w = 1.0
    return marker


def scene_markers(scene: Scene, ball: NDArray[np.float64], path: list[NDArray[np.float64]]) -> MarkerArray:
    """Markers of the table, the net, the ball at `ball` (3,) and the `path` it has flown."""
    table, net = scene.table, scene.net
    top = _marker("table", 0, Marker.CUBE, (table.length_m, table.width_m, table.thickness_m), TABLE_BLUE)
    top.pose.position.z = table.height_m - table.thickness_m / 2
    mesh = _marker(
        "net", 1, Marker.CUBE, (net.thickness_m, table.width_m + 2 * net.overhang_m, net.height_m), NET_WHITE
    )
    mesh.pose.position.z = table.height_m + net.height_m / 2
    diameter = 2 * scene.ball.radius_m
    sphere = _marker("ball", 2, Marker.SPHERE, (diameter, diameter, diameter), BALL_ORANGE)
    sphere.pose.position.x, sphere.pose.position.y, sphere.pose.position.z = map(float, ball)
    markers = [top, mesh, sphere]
    if len(path) > 1:
        line = _marker("path", 3, Marker.LINE_STRIP, (0.01, 0.0, 0.0), BALL_ORANGE)
        line.points = [Point(x=float(p[0]), y=float(p[1]), z=float(p[2])) for p in path]
        markers.append(line)
    return MarkerArray(markers=markers)


def target_markers(target: NDArray[np.float64] | None) -> MarkerArray:
    """The target of the next stroke (2,), m, as a disc on the table; None takes it away."""
    table = Scene().table
    size = (TARGET_DIAMETER_M, TARGET_DIAMETER_M, 0.004)
    disc = _marker("target", 4, Marker.CYLINDER, size, TARGET_GREEN)
    disc.pose.position.z = table.height_m
    if target is None:
        disc.action = Marker.DELETE
    else:
        disc.pose.position.x, disc.pose.position.y = map(float, target)
    return MarkerArray(markers=[disc])


def transform_stamped(
    parent: str, child: str, position: NDArray[np.float64], quaternion: NDArray[np.float64], stamp: Any
) -> TransformStamped:
    """One frame: position (3,) in m and quaternion (x, y, z, w) of `child` in `parent`."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.header.stamp = stamp
    message.transform = transform(position, quaternion)
    return message
