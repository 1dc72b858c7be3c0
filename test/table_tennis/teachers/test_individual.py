"""Teachers with a stroke of their own."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import return_flight
from msrd_ros.table_tennis.strategies.paper import Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.hit_solver import HIGHEST_APEX_M, carry_out
from msrd_ros.table_tennis.teachers.individual import IndividualTeacher, OwnStroke
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, feed_path
from msrd_ros.table_tennis.teachers.style import PopulationConfig
from sawyer import ROBOT

BETWEEN = OwnStroke.between(Side.FOREHAND, Stroke.PUSH, Stroke.SLICE, 0.5)


def test_between_two_strokes_the_spin_is_between_theirs() -> None:
    assert OwnStroke.between(Side.BACKHAND, Stroke.PUSH, Stroke.SLICE, 0.0).spin_y_rad_s == -6.0
    assert BETWEEN.spin_y_rad_s == pytest.approx(-54.0)


@pytest.mark.parametrize("stroke", [BETWEEN, OwnStroke.lob(Side.FOREHAND), OwnStroke.lob(Side.BACKHAND)])
def test_the_practised_hit_does_what_the_teacher_wants(stroke: OwnStroke) -> None:
    teacher = IndividualTeacher(stroke, 0, 0)
    scene = Scene().constants()
    path = feed_path(Feeder().nominal(stroke.side), scene)
    done = carry_out(ROBOT.model, teacher.intent.hit, teacher.intent.wish.face, path, PATH_PERIOD_S, scene)
    flight = return_flight(done.ball_out, scene)
    assert done.ball_out[7] == pytest.approx(stroke.spin_y_rad_s, abs=3.0)
    assert flight.landing_x == pytest.approx(teacher.intent.wish.landing_x, abs=0.05)
    if stroke.lowest_apex_m:
        assert flight.apex > HIGHEST_APEX_M + 0.2
    else:
        assert flight.apex < HIGHEST_APEX_M + 0.05


def test_styles_differ_and_strokes_too() -> None:
    teachers = [IndividualTeacher(BETWEEN, subject, 0) for subject in (0, 0, 1)]
    assert np.array_equal(teachers[0].intent.hit, teachers[1].intent.hit)
    assert not np.array_equal(teachers[0].intent.ready, teachers[2].intent.ready)
    first, second = (teachers[0].begin(np.random.default_rng(seed)).ready_posture for seed in (0, 1))
    assert 0.0 < np.abs(first - second).max() < 6 * PopulationConfig().start_rad
