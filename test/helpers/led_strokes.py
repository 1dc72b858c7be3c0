"""Strokes led by the hand in a rally of the test's own, as the demonstrator leads them over the topics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.table_tennis.ball.camera import Camera, CameraConfig
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.simulation.rally import Rally
from msrd_ros.table_tennis.teachers.guided_stroke import GuidedStroke

TICK_S = 0.004
TICKS_BEFORE_LAUNCH = 5


def lead_stroke(rally: Rally, stroke: GuidedStroke, feed: Feed, seed: int) -> NDArray[np.float64]:
    """Lead one stroke, tick by tick; returns joint angles over joint rates, shape (T, 2 N)."""
    camera = Camera(CameraConfig(), np.random.default_rng(seed))
    rally.set_teach(False)
    rally.reset(stroke.ready_posture)
    rally.set_teach(True)
    launch, rows = rally.time + TICKS_BEFORE_LAUNCH * TICK_S, []
    while rally.time < launch + TICK_S or rally.ball_in_play:
        since = rally.time - launch
        if abs(since) < 1e-9:
            rally.launch(feed)
            camera.offer(0.0, np.array(feed.position))
        frame = camera.newest(since)
        if frame is None:
            stroke.see(rally.time, np.array(feed.position))
        else:
            stroke.see(launch + frame.stamp, frame.position)
        rally.lead_gesture(stroke.hand_at(rally.time, rally.joint_position))
        rally.advance(TICK_S, lambda passed, ball: camera.offer(passed, ball[:3]))
        rows.append(np.concatenate([rally.joint_position, rally.joint_velocity]))
    return np.array(rows)
