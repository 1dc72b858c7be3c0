"""Sketched strokes led by the hand: they return the balls that come, within limits, as was foretold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drawn_sketches import ARMS, SPINS_RAD_S, drawn
from led_strokes import TICK_S, TICKS_BEFORE_LAUNCH, lead_stroke
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import turned
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feeder
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.sketch import Ghost, Sketch
from msrd_ros.table_tennis.teachers.sketch_plan import plan_sketch, plan_variation
from msrd_ros.table_tennis.teachers.sketched_stroke import SketchedStroke

pytestmark = pytest.mark.slow

FEEDS = 4


@pytest.fixture(scope="module", params=ARMS)
def rally(request: pytest.FixtureRequest) -> Iterator[Rally]:
    with Rally(RallyConfig(robot=load_robot(request.param))) as one:
        yield one


def _stroke(robot: Robot, sketch: Sketch) -> SketchedStroke:
    return SketchedStroke(robot, plan_sketch(robot, sketch))


def _check_motion(robot: Robot, rows: np.ndarray) -> None:
    rates = np.abs(rows[:, robot.joint_count :]) / robot.limits.speed_rad_s
    assert rates.max() < 1.01
    assert rates[:TICKS_BEFORE_LAUNCH].max() < 0.05, "the arm waits for the ball"
    assert rates[-20:].max() < 0.15, "the arm has come to rest"


def test_standard_balls_come_back(rally: Rally) -> None:
    """Each motion on each side, some standard feeds each: nine of ten come back, all within limits."""
    robot, returned = rally.config.robot, []
    for motion in SPINS_RAD_S:
        for side in Side:
            for seed in range(FEEDS):
                feed = Feeder().sample(side, STANDARD, np.random.default_rng((5, seed)))
                rows = lead_stroke(rally, _stroke(robot, drawn(robot.name, side, motion)), feed, seed)
                _check_motion(robot, rows)
                assert rally.outcome is not None
                returned.append(rally.outcome.returned)
    assert np.mean(returned) >= 0.9


def test_ghosts_that_a_hand_has_pushed_about_do_as_well(rally: Rally) -> None:
    """Each ghost off by centimetres and degrees: what is foretold to come back does, from standard feeds."""
    robot, rng, returned = rally.config.robot, np.random.default_rng(1), []
    for side in Side:
        for motion in SPINS_RAD_S:
            sketch = drawn(robot.name, side, motion)
            pushed = {
                moment: Ghost.of(
                    ghost.position + 0.015 * rng.standard_normal(3),
                    turned(ghost.rotation, 0.06 * rng.standard_normal(3)),
                )
                for moment, ghost in sketch.ghosts.items()
            }
            plan = plan_sketch(robot, sketch.with_ghosts(pushed))
            if plan.violations or not plan.prediction.outcome.returned:
                continue
            for seed in range(2):
                feed = Feeder().sample(side, STANDARD, np.random.default_rng((9, seed)))
                _check_motion(robot, lead_stroke(rally, SketchedStroke(robot, plan), feed, seed))
                assert rally.outcome is not None
                returned.append(rally.outcome.returned)
    assert len(returned) >= 6
    assert np.mean(returned) >= 0.9


@pytest.mark.parametrize("motion", SPINS_RAD_S)
@pytest.mark.parametrize("side", list(Side))
def test_the_expected_ball_does_what_was_foretold(rally: Rally, side: Side, motion: str) -> None:
    robot = rally.config.robot
    stroke = _stroke(robot, drawn(robot.name, side, motion))
    lead_stroke(rally, stroke, Feeder().nominal(side), 0)
    foretold, played = stroke.plan.prediction.outcome, rally.outcome
    assert played is not None
    assert played.returned
    assert played.hit_time_s == pytest.approx(foretold.hit_time_s, abs=0.015)
    assert played.landing_x_m == pytest.approx(foretold.landing_x_m, abs=0.2)
    assert played.landing_y_m == pytest.approx(foretold.landing_y_m, abs=0.2)
    assert played.spin_y_rad_s == pytest.approx(foretold.spin_y_rad_s, abs=15.0)


def test_variations_come_back_and_differ(rally: Rally) -> None:
    robot, rng, hits, returned = rally.config.robot, np.random.default_rng(3), [], []
    for seed in range(4):
        plan = plan_variation(robot, drawn(robot.name, Side.FOREHAND), rng)
        feed = Feeder().sample(Side.FOREHAND, STANDARD, rng)
        lead_stroke(rally, SketchedStroke(robot, plan), feed, seed)
        assert rally.outcome is not None
        returned.append(rally.outcome.returned)
        hits.append(rally.outcome.hit_time_s)
    assert sum(returned) >= 3
    assert np.ptp(hits) > 0.005


def test_the_paddle_goes_where_the_ball_comes(rally: Rally) -> None:
    robot, met = rally.config.robot, []
    for sideways in (-0.03, 0.03):
        feed = replace(Feeder().nominal(Side.FOREHAND), position=(1.5, sideways, 1.06))
        rows = lead_stroke(rally, _stroke(robot, drawn(robot.name, Side.FOREHAND)), feed, 0)
        assert rally.outcome is not None
        row = rows[TICKS_BEFORE_LAUNCH + round(rally.outcome.hit_time_s / TICK_S)]
        met.append(paddle_pose(robot.model, row[: robot.joint_count])[0][1])
    assert met[1] - met[0] == pytest.approx(0.06, abs=0.03)


def test_an_arm_that_waits_elsewhere_winds_up_first(rally: Rally) -> None:
    robot, sketch = rally.config.robot, drawn(rally.config.robot.name, Side.BACKHAND)
    assert sketch.ready_rad is not None
    ready = np.array(sketch.ready_rad) + 0.05
    plan = plan_sketch(robot, replace(sketch, ready_rad=tuple(ready)))
    assert plan.stroke.lead_in is not None
    stroke = SketchedStroke(robot, plan)
    np.testing.assert_allclose(stroke.ready_posture, ready)
    rows = lead_stroke(rally, stroke, Feeder().nominal(Side.BACKHAND), 0)
    _check_motion(robot, rows)
    assert rally.outcome is not None
    assert rally.outcome.returned


def test_a_sketch_that_misses_is_led_as_it_is() -> None:
    robot, sketch = load_robot("sawyer"), drawn("sawyer", Side.FOREHAND)
    away = np.array([0.0, 0.0, 0.12])
    above = sketch.with_ghosts({moment: ghost.moved(away) for moment, ghost in sketch.ghosts.items()})
    plan = plan_sketch(robot, replace(above, swing_s=0.8, follow_s=0.8, ready_rad=None))
    assert not plan.prediction.outcome.struck
    with Rally(RallyConfig(robot=robot)) as rally:
        lead_stroke(rally, SketchedStroke(robot, plan), Feeder().nominal(Side.FOREHAND), 0)
        assert rally.outcome is not None
        assert not rally.outcome.struck


def test_nothing_moves_that_the_arm_cannot_do() -> None:
    robot, sketch = load_robot("sawyer"), drawn("sawyer", Side.FOREHAND)
    with pytest.raises(UserError, match="my-push-like"):
        _stroke(robot, replace(sketch, swing_s=0.1))
