"""What the teacher of rallies shows, and what it answers to an arm that strays."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.rally.lesson import Lesson
from msrd_ros.table_tennis.ball.ends import turned
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feeder
from msrd_ros.table_tennis.strategies.paper import PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.rally_teacher import SOUND_COST, RallyTeacher
from sawyer import ROBOT

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("side", Side)
def test_the_teacher_returns_feeds_and_what_comes_of_them(side: Side) -> None:
    teacher = RallyTeacher(PaperLabel(side, Stroke.PUSH), ROBOT)
    balls = Feeder().sample_states(side, STANDARD, 30, np.random.default_rng(2))
    for _ in range(3):
        lesson = Lesson(teacher, balls)
        answers, results = lesson.play(None, 1.0, 0.0, 6.0, 0.008, np.random.default_rng(3))
        assert lesson.sound.mean() > 0.95
        assert results.returned[0].mean() > 0.95
        assert len(answers.actions) == lesson.sound.sum()
        error_m = results.landing[0][results.returned[0]] - teacher.landing_m
        assert np.abs(np.median(error_m, axis=0)).max() < 0.05
        # The partner has it back on the same side of its own.
        balls = turned(results.struck_ball[0][results.returned[0]])
        assert (np.sign(balls[:, 4]) == side.sign).all()


def test_no_stroke_is_sound_against_a_ball_that_flies_wide() -> None:
    teacher = RallyTeacher(PaperLabel(Side.FOREHAND, Stroke.PUSH), ROBOT)
    ball = Feeder().nominal(Side.FOREHAND).state()
    ball[4] = -3.0
    assert teacher.plan(ball)[1] > SOUND_COST


def test_an_arm_that_has_strayed_is_told_to_come_back() -> None:
    teacher = RallyTeacher(PaperLabel(Side.FOREHAND, Stroke.PUSH), ROBOT)
    lesson = Lesson(teacher, Feeder().nominal(Side.FOREHAND).state()[None])
    waiting = lesson.answer(0, teacher.ready_pose[None], 6.0)
    np.testing.assert_allclose(waiting, 0.0, atol=1e-9)
    astray = lesson.answer(0, teacher.ready_pose[None] + 0.05, 6.0)
    np.testing.assert_allclose(astray, -0.3, atol=1e-9)
