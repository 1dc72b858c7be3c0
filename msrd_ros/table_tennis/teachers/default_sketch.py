"""Where the ghosts stand before a person moves them: some stroke within limits that returns the ball."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feed, Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.hit_solver import TIME, HitWish, angles_of, rates_of, solve_hit
from msrd_ros.table_tennis.teachers.planner import LEAST_ROOM_ON_PATH_M, room_on_path
from msrd_ros.table_tennis.teachers.side import (
    HAND_SHARE,
    PATH_PERIOD_S,
    face_sign,
    feed_path,
    singular_residual,
)
from msrd_ros.table_tennis.teachers.sketch import Ghost, Sketch
from msrd_ros.table_tennis.teachers.sketch_plan import plan_sketch

Array = NDArray[np.float64]

_SEARCHES = 200
_STEPS = 40
_SWING_S, _FOLLOW_S = 0.42, 0.42
_HIGHEST_RATE = 0.55
_LANDING_M = (0.75, 0.0)
_WORST_COST = 20.0
_BEFORE_FALLING_S = 0.12
"""A ball is met so long after the top of its bounce, give or take the half of it."""
_RUN_UP = 1.875
"""A minimum-jerk half way is the final rate times its duration, divided by this."""


def default_sketch(
    robot: Robot,
    side: Side,
    feed: Feed | None = None,
    *,
    strategy: str = "sketch",
    spin_y_rad_s: float = 0.0,
    scene: Scene | None = None,
    seed: int = 0,
) -> Sketch:
    """A stroke to begin with, found for any arm from postures drawn at random; takes a second or a few.

    Parameters
    ----------
    robot
        The arm, of N joints.
    side
        Where the ball goes, and which face meets it.
    feed
        The ball; the nominal one of the side if None.
    strategy
        What the stroke is called.
    spin_y_rad_s
        Spin about y right after the hit: with it the paddle goes up (positive) or down through the ball.
    scene
        The standard one if None.
    seed
        Of the draws.

    Raises
    ------
    UserError
        If no such stroke is found.
    """
    scene, feed = scene or Scene(), feed or Feeder().nominal(side)
    grip = GuidanceConfig()
    gentle = replace(
        grip,
        force_limit_n=HAND_SHARE * grip.force_limit_n,
        torque_limit_nm=HAND_SHARE * grip.torque_limit_nm,
    )
    label = StrategyLabel.parse(strategy, "sketch: strategy")
    for hit in _hits(robot, side, feed, spin_y_rad_s, scene.constants(), np.random.default_rng(seed)):
        sketch = _around(robot, label, side, feed, hit)
        plan = plan_sketch(robot, sketch, scene, gentle)
        if plan.violations or not plan.prediction.outcome.returned:
            continue
        if singular_residual(robot.model, plan.stroke.hit_position) > 0.0:
            continue  # Another ball would cost too much.
        ready = plan.states.position[0]
        ways = ((robot.home_rad, ready), (ready, robot.home_rad))
        if all(room_on_path(robot, *way) > LEAST_ROOM_ON_PATH_M for way in ways):
            return sketch
    raise UserError(
        f"sketch {strategy}: found no {side} stroke of the {robot.name} that returns this ball with a spin "
        f"of {spin_y_rad_s:g} rad/s; ask for less spin, or for another ball"
    )


def _around(robot: Robot, label: StrategyLabel, side: Side, feed: Feed, hit: Array) -> Sketch:
    """Ghosts on a straight way through a hit, such that the smoothest motion through them is this hit."""
    contact, rates = angles_of(hit), rates_of(hit) * robot.limits.speed_rad_s
    ready = contact - rates * (_SWING_S / _RUN_UP)
    end = contact + rates * (_FOLLOW_S / _RUN_UP)
    wind_up, meeting, rest = (Ghost.of(*paddle_pose(robot.model, at)) for at in (ready, contact, end))
    return Sketch(
        label,
        side,
        feed,
        wind_up,
        meeting,
        rest,
        contact_s=float(hit[TIME]),
        swing_s=_SWING_S,
        follow_s=_FOLLOW_S,
        ready_rad=tuple(map(float, np.clip(ready, robot.limits.lowest_rad, robot.limits.highest_rad))),
    )


def _hits(
    robot: Robot,
    side: Side,
    feed: Feed,
    spin_y_rad_s: float,
    scene: NDArray[np.void],
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Hits (1 + 2 N,) of `hit_solver`, the best first."""
    path = feed_path(feed, scene)
    time = _when_to_hit(path)
    planning, count = robot.planning, robot.joint_count
    found = []
    for _ in range(_SEARCHES):
        posture = rng.uniform(planning.hit_lower_rad, planning.hit_upper_rad)
        wish = HitWish(
            face=face_sign(side),
            spin_y=spin_y_rad_s,
            landing_x=_LANDING_M[0],
            landing_y=_LANDING_M[1],
            time=time,
            time_slack=0.5 * _BEFORE_FALLING_S,
            highest_rate=_HIGHEST_RATE,
            posture=posture,
            posture_weight=0.1,
            rates=np.zeros(count),
            rates_weight=0.0,
            lower=planning.hit_lower_rad,
            upper=planning.hit_upper_rad,
        )
        start = np.concatenate([[time], posture, np.zeros(count)])
        hit, cost = solve_hit(robot.model, start, wish, path, PATH_PERIOD_S, scene, _STEPS)
        if cost < _WORST_COST:
            found.append((cost, hit))
    found.sort(key=lambda each: each[0])
    return iter([hit for _, hit in found])


def _when_to_hit(path: Array) -> float:
    """Shortly after the top of the bounce on the robot's half, s since the launch."""
    height, rate = path[:, 2], path[:, 5]
    bounces = np.flatnonzero((rate[:-1] < 0.0) & (rate[1:] > 0.0) & (path[1:, 0] < 0.0))
    if not len(bounces):
        raise UserError("sketch: this ball does not bounce on the robot's half; feed another")
    first = int(bounces[0]) + 1
    top = first + int(np.argmax(rate[first:] < 0.0))
    assert height[top] >= height[first]
    return top * PATH_PERIOD_S + _BEFORE_FALLING_S
