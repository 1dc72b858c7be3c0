"""Ways between strokes: tried out in Bullet, whose driver holds back an arm that makes for the table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.loading import load_robot, shipped_robots
from msrd_ros.table_tennis.arm.collision_model import self_clearance
from msrd_ros.table_tennis.arm.via_point_path import find_path, follow_path
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.strokes.player import Phase, StrokePlayer
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import HOME_POSTURE_RAD, ROBOT

OVER_THE_TABLE = np.array([-0.15, -0.16, -0.26, 0.70, -1.16, 0.52, 0.24])
"""Where a badly trained slice once ended: the straight path to its own ready pose grazes the table."""


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    world = World(WorldConfig())
    yield world
    world.close()


def ready_pose(label: PaperLabel) -> np.ndarray:
    return planned_strokes()[label].start.position


def strays_on_the_way(world: World, start: np.ndarray, goal: np.ndarray) -> int:
    """Lead an arm from rest to rest; how often it was held back further than tracking allows."""
    world.rally.reset(start)
    player = StrokePlayer(ROBOT, start)
    player.prepare(None, goal)
    strays = 0
    for _ in range(600):
        tick = world.tick()
        strays += player.follow(tick.joint_position) > 0.25
        reference = player.tick(tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        world.command(reference.position, reference.velocity, CONTROL_PERIOD_S, None)
        world.advance(CONTROL_PERIOD_S)
        if player.phase is Phase.READY and world.rally.at_rest:
            break
    np.testing.assert_array_equal(world.rally.joint_position, goal)
    return strays


@pytest.mark.slow
@pytest.mark.parametrize("ended", ALL_LABELS)
def test_the_arm_gets_from_the_end_of_every_stroke_to_every_ready_pose(
    world: World, ended: PaperLabel
) -> None:
    end = planned_strokes()[ended].at(2.0).position
    assert [strays_on_the_way(world, end, ready_pose(label)) for label in ALL_LABELS] == [0] * 6


def test_an_arm_low_over_the_table_is_lifted_first(world: World) -> None:
    goal = ready_pose(ALL_LABELS[1])
    assert find_path(ROBOT, JointReference(OVER_THE_TABLE, np.zeros(7)), goal) != []
    assert strays_on_the_way(world, OVER_THE_TABLE, goal) == 0


def test_where_nothing_is_in_the_way_it_is_straight() -> None:
    assert find_path(ROBOT, JointReference(HOME_POSTURE_RAD, np.zeros(7)), ready_pose(ALL_LABELS[0])) == []


@pytest.mark.parametrize("name", shipped_robots())
def test_between_strokes_an_arm_keeps_clear_of_itself(name: str) -> None:
    robot = load_robot(name)
    strokes = planned_strokes(robot).values()
    poses = [robot.home_rad, *(stroke.start.position for stroke in strokes)]
    for start in poses + [stroke.at(2.0).position for stroke in strokes]:
        for goal in poses:
            reference = JointReference(start.copy(), np.zeros_like(start))
            left: Sequence[np.ndarray] = find_path(robot, reference, goal)
            while left or np.abs(reference.position - goal).max() > 1e-3:
                reference, left = follow_path(robot, reference, left, goal, CONTROL_PERIOD_S)
                assert self_clearance(robot.model, reference.position) > 0.02
