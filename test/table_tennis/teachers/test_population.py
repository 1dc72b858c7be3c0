"""Synthetic teachers: their style, what they make of the camera, and strokes led in teach mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from led_strokes import TICK_S, TICKS_BEFORE_LAUNCH, lead_stroke
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.table_tennis.ball.camera import Camera, CameraConfig
from msrd_ros.table_tennis.ball.estimator import PATH_PERIOD_S, FlightEstimator
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feed, Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path, path_at
from msrd_ros.table_tennis.simulation.rally import Rally
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.population import Teacher
from msrd_ros.table_tennis.teachers.study_design import Verdict, judge_stroke
from msrd_ros.table_tennis.teachers.style import Flaws, PopulationConfig, Slip, Style
from sawyer import ARM, ROBOT, SPEED_LIMIT_RAD_S

pytestmark = pytest.mark.slow

SCENE = Scene().constants()
NO_SLIPS = PopulationConfig(slip_least=0.0, slip_most=0.0)


# -- what a teacher sees ---------------------------------------------------------------------------------


def _watch(feed: Feed, seconds: float, camera: CameraConfig, rng: np.random.Generator) -> FlightEstimator:
    """Let an estimator see a feed for a while through a camera; the launch is at time 5."""
    truth = ball_path(feed.state(), 0.001, 1001, SCENE)
    eye = Camera(camera, rng)
    estimator = FlightEstimator(SCENE)
    estimator.see(4.99, truth[0, :3])
    for index in range(round(seconds * 1000)):
        eye.offer(index * 0.001, truth[index, :3])
        sample = eye.newest(index * 0.001)
        if sample is not None:
            estimator.see(5.0 + sample.stamp, sample.position)
    return estimator


@pytest.mark.parametrize(
    ("camera", "seconds", "most_m"),
    [
        (CameraConfig(), 0.25, 0.015),
        (CameraConfig(), 0.45, 0.006),
        (CameraConfig(), 0.75, 0.003),
        (CameraConfig(rate_hz=60.0, noise_std_m=0.003, latency_s=0.02, dropout=0.1), 0.45, 0.030),
        (CameraConfig(rate_hz=60.0, noise_std_m=0.003, latency_s=0.02, dropout=0.1), 0.80, 0.012),
    ],
)
def test_estimated_flight_meets_the_ball(camera: CameraConfig, seconds: float, most_m: float) -> None:
    """Predicted place at 0.94 s after the launch, root mean square over 30 standard feeds."""
    errors = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        feed = Feeder().sample(Side.FOREHAND, STANDARD, rng)
        estimator = _watch(feed, seconds, camera, rng)
        path = estimator.path()
        assert path is not None
        assert estimator.first_seen_s is not None
        truth = path_at(ball_path(feed.state(), 0.001, 1001, SCENE), 0.001, 0.94)
        seen = path_at(path, PATH_PERIOD_S, 5.94 - estimator.first_seen_s)
        errors.append(np.linalg.norm(seen[:3] - truth[:3]))
    assert np.sqrt(np.mean(np.square(errors))) < most_m


def test_estimator_waits_for_the_flight_and_ignores_repeated_samples() -> None:
    estimator = FlightEstimator(SCENE)
    still = np.array([1.5, 0.0, 1.06])
    for tick in range(10):
        assert not estimator.see(tick * 0.004, still)
    assert (estimator.first_seen_s, estimator.samples) == (None, 0)
    assert estimator.path() is None
    flying = still - np.array([0.02, 0.0, 0.0])
    assert estimator.see(0.04, flying)
    assert not estimator.see(0.04, flying)
    assert not estimator.see(0.03, still)
    assert (estimator.first_seen_s, estimator.samples) == (0.04, 1)
    estimator.forget()
    assert estimator.first_seen_s is None


# -- who the teachers are --------------------------------------------------------------------------------


def test_habits_come_from_the_seed_and_the_subject() -> None:
    one, same, other = Teacher(2, 7), Teacher(2, 7), Teacher(3, 7)
    assert repr(one.style) == repr(same.style)
    assert repr(one.style) != repr(other.style)
    assert one.name == "subject_03"
    for label in ALL_LABELS:
        np.testing.assert_array_equal(one.intent(label).hit, same.intent(label).hit)
        assert np.abs(one.intent(label).ready - other.intent(label).ready).max() > 0.01


def test_start_postures_vary_from_stroke_to_stroke() -> None:
    teacher, rng = Teacher(0, 0), np.random.default_rng(0)
    starts = np.array([teacher.begin(ALL_LABELS[0], rng).ready_posture for _ in range(200)])
    np.testing.assert_allclose(starts.std(axis=0), PopulationConfig().start_rad, rtol=0.25)
    np.testing.assert_allclose(starts.mean(axis=0), teacher.intent(ALL_LABELS[0]).ready, atol=0.01)


def test_slips_are_as_frequent_as_the_habit_says() -> None:
    rng, population = np.random.default_rng(1), PopulationConfig()
    style = replace(Style.draw(population, ROBOT.joint_count, rng), slip=0.3)
    slips = [Flaws.draw(style, population, rng).slip for _ in range(2000)]
    assert np.mean([slip is not Slip.NONE for slip in slips]) == pytest.approx(0.3, abs=0.04)
    assert set(slips) == set(Slip)


def test_a_wrong_population_is_named() -> None:
    with pytest.raises(UserError, match="tremor_m"):
        PopulationConfig(tremor_m=-0.1)


# -- leading the arm -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rally() -> Iterator[Rally]:
    with Rally() as one:
        yield one


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_teachers_return_balls_by_the_hand_within_limits(rally: Rally, label: PaperLabel) -> None:
    """Three teachers, one standard feed each, without slips: kept all, or all but one."""
    kept = 0
    for subject in range(3):
        rng = np.random.default_rng((11, subject))
        stroke = Teacher(subject, 0, NO_SLIPS).begin(label, rng)
        rows = lead_stroke(rally, stroke, Feeder().sample(label.side, STANDARD, rng), subject)
        peak = float(np.abs(rows[:, 7:] / SPEED_LIMIT_RAD_S).max())
        assert peak < 1.01
        assert np.abs(rows[:5, 7:]).max() < 0.05, "the arm waits for the ball"
        assert np.abs(rows[-20:, 7:]).max() < 0.2, "the arm has come to rest"
        steps = np.abs(np.diff(rows[:, 7:], axis=0)) / SPEED_LIMIT_RAD_S
        assert steps.max() < 0.2, "rates are smooth from tick to tick"
        assert rally.outcome is not None
        kept += judge_stroke(label, rally.outcome, peak) is Verdict.KEPT
    assert kept >= 2


def test_a_stroke_repeats_exactly_from_its_seed(rally: Rally) -> None:
    shows = []
    for _ in range(2):
        rng = np.random.default_rng(3)
        stroke = Teacher(1, 0).begin(ALL_LABELS[5], rng)
        shows.append(lead_stroke(rally, stroke, Feeder().sample(Side.BACKHAND, STANDARD, rng), 0)[:300])
    np.testing.assert_allclose(shows[0], shows[1], atol=1e-9)


def test_the_hand_answers_the_ball(rally: Rally) -> None:
    """A ball further to the side is met further to the side, by about as much."""
    met = []
    for sideways in (-0.03, 0.03):
        nominal = Feeder().nominal(Side.FOREHAND)
        feed = replace(nominal, position=(1.5, sideways, 1.06))
        stroke = Teacher(0, 0, NO_SLIPS).begin(ALL_LABELS[0], np.random.default_rng(2))
        rows = lead_stroke(rally, stroke, feed, 0)
        assert rally.outcome is not None
        assert rally.outcome.returned
        met.append(
            paddle_pose(ARM, rows[TICKS_BEFORE_LAUNCH + round(rally.outcome.hit_time_s / TICK_S), :7])[0][1]
        )
    assert met[1] - met[0] == pytest.approx(0.06, abs=0.03)


def test_an_inattentive_teacher_plays_as_always(rally: Rally) -> None:
    ways = []
    for speed in (0.98, 1.02):
        nominal = Feeder().nominal(Side.FOREHAND)
        vx, vy, vz = nominal.velocity
        feed = replace(nominal, velocity=(speed * vx, speed * vy, speed * vz))
        stroke = Teacher(0, 0, NO_SLIPS).begin(ALL_LABELS[0], np.random.default_rng(2))
        stroke.flaws = replace(stroke.flaws, slip=Slip.INATTENTIVE)
        ways.append(lead_stroke(rally, stroke, feed, 0)[:250, :7])
    np.testing.assert_allclose(ways[0], ways[1], atol=0.02)
