"""Planned strokes: feasible, within limits, clear of the table, and they return the ball as asked."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.core.paddle import BLADE_RADIUS_M
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.quintic import JointState, JointStroke, swing_effort
from msrd_ros.table_tennis.ball.feeder import EASY, NO_SPREAD, STANDARD, Feeder, FeedSpread
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path, path_at, return_flight
from msrd_ros.table_tennis.simulation.batched import RallyResults
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel, Stroke
from msrd_ros.table_tennis.strategies.table import Side, Strategies
from msrd_ros.table_tennis.teachers.hit_solver import TIME, carry_out, rates_of, solve_hit
from msrd_ros.table_tennis.teachers.open_loop import play_open_loop
from msrd_ros.table_tennis.teachers.planner import (
    MOST_COST,
    PLAN_FILE,
    find_fault,
    kept_strokes,
    plan_side,
    planned_strokes,
    room_on_path,
    write_strokes,
)
from msrd_ros.table_tennis.teachers.side import (
    PATH_PERIOD_S,
    PlannerConfig,
    SideProblem,
    face_sign,
    feed_path,
    singular_residual,
    wish_for,
)
from sawyer import ARM, HOME_POSTURE_RAD, POSITION_LOWER_RAD, POSITION_UPPER_RAD, ROBOT, SPEED_LIMIT_RAD_S

pytestmark = pytest.mark.slow

SCENE = Scene().constants()
SPIN_RANGES = {Stroke.PUSH: (-18.0, 5.0), Stroke.SLICE: (-115.0, -90.0), Stroke.TOPSPIN: (95.0, 125.0)}


def _hit_of(stroke: JointStroke) -> np.ndarray:
    return np.concatenate([[stroke.hit_time_s], stroke.hit_position, stroke.hit_velocity / SPEED_LIMIT_RAD_S])


def _play_open_loop(spread: FeedSpread, rallies: int) -> RallyResults:
    """Play the planned joint rates, whatever the ball does, in the batched simulator."""
    rng = np.random.default_rng(5)
    return play_open_loop(ROBOT, planned_strokes(), rng, spread=spread, rallies=rallies)


# -- the motion ------------------------------------------------------------------------------------------


def _random_stroke(rng: np.random.Generator) -> JointStroke:
    start = JointState(*(rng.normal(size=7) for _ in range(3)))
    return JointStroke(0.3, start, 0.9, rng.normal(size=7), rng.normal(size=7), 0.3)


def test_rates_and_accelerations_are_derivatives() -> None:
    stroke = _random_stroke(np.random.default_rng(0))
    step = 1e-5
    for time in (0.31, 0.5, 0.7, 0.89, 0.95, 1.1, 1.19):
        before, here, after = (stroke.at(time + offset) for offset in (-step, 0.0, step))
        slope = (after.position - before.position) / (2 * step)
        np.testing.assert_allclose(slope, here.velocity, atol=1e-6)
        slope = (after.velocity - before.velocity) / (2 * step)
        np.testing.assert_allclose(slope, here.acceleration, atol=1e-5)


def test_stroke_meets_its_ends() -> None:
    stroke = _random_stroke(np.random.default_rng(1))
    hit = stroke.at(stroke.hit_time_s)
    np.testing.assert_allclose(hit.position, stroke.hit_position, atol=1e-12)
    np.testing.assert_allclose(hit.velocity, stroke.hit_velocity, atol=1e-12)
    np.testing.assert_allclose(hit.acceleration, 0.0, atol=1e-9)
    start = stroke.at(stroke.start_time_s + 1e-9)
    for got, wanted in zip(start, stroke.start, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-6)
    np.testing.assert_array_equal(stroke.at(9.0).velocity, 0.0)


def test_a_corrected_stroke_goes_on_smoothly_to_the_new_hit() -> None:
    stroke = _random_stroke(np.random.default_rng(2))
    other = stroke.continued_from(0.6, 0.95, stroke.hit_position + 0.1, stroke.hit_velocity)
    for got, wanted in zip(other.at(0.6), stroke.at(0.6), strict=True):
        np.testing.assert_allclose(got, wanted)
    np.testing.assert_allclose(other.at(0.95).position, stroke.hit_position + 0.1)


def test_swing_effort_is_the_peak_of_the_swing() -> None:
    for label, stroke in planned_strokes().items():
        speed, acceleration = stroke.peak_fractions(ROBOT.limits)
        assert swing_effort(stroke, ROBOT) <= max(speed.max(), acceleration.max()) + 1e-9, label
        assert swing_effort(stroke, ROBOT) >= 0.95 * speed.max(), label


# -- the ball's path -------------------------------------------------------------------------------------


def test_path_bounces_where_the_feed_does() -> None:
    """Numbers of the physical scene: one bounce at x = -0.90, the hit region at 0.94 s."""
    path = ball_path(Feeder().nominal(Side.FOREHAND).state(), 0.002, 500, SCENE)
    bounce = int(np.argmin(path[:400, 2]))
    assert path[bounce, 0] == pytest.approx(-0.897, abs=0.02)
    np.testing.assert_allclose(path_at(path, 0.002, 0.94)[:3], [-1.58, -0.35, 1.06], atol=0.01)
    np.testing.assert_allclose(path_at(path, 0.002, 0.94)[3:6], [-1.90, -0.22, -0.94], atol=0.03)


def test_path_does_not_depend_on_its_period() -> None:
    launch = Feeder().nominal(Side.BACKHAND).state()
    fine, coarse = ball_path(launch, 0.001, 1001, SCENE), ball_path(launch, 0.005, 201, SCENE)
    np.testing.assert_allclose(coarse, fine[::5], atol=1e-5)


# -- hits ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_solver_finds_a_hit_from_a_bad_start(label: PaperLabel) -> None:
    config = PlannerConfig()
    path = feed_path(Feeder().nominal(label.side), SCENE)
    known = _hit_of(planned_strokes()[label])
    start = known + 0.08 * np.random.default_rng(3).standard_normal(15) * (np.arange(15) > 0)
    wish = wish_for(ROBOT, label, config, known[1:8], 0.1)
    hit, cost = solve_hit(ARM, start, wish, path, PATH_PERIOD_S, SCENE, 100)
    assert cost < 1.0
    done = carry_out(ARM, hit, face_sign(label.side), path, PATH_PERIOD_S, SCENE)
    flight = return_flight(done.ball_out, SCENE)
    assert np.linalg.norm(done.off_centre) < 0.005
    assert done.ball_out[7] == pytest.approx(config.spin(label.stroke), abs=4.0)
    assert flight.landing_x == pytest.approx(config.landing_m[0], abs=0.1)
    assert flight.net_height > Scene().table.height_m + Scene().net.height_m + 0.1
    assert np.abs(rates_of(hit)).max() <= config.highest_rate + 0.02
    assert abs(hit[TIME] - config.hit_time_s) <= config.hit_time_slack_s + 0.01


# -- planned strokes -------------------------------------------------------------------------------------


def test_each_side_has_one_ready_pose() -> None:
    for side in Side:
        ready = [planned_strokes()[PaperLabel(side, stroke)].start.position for stroke in Stroke]
        np.testing.assert_array_equal(ready, [ready[0]] * 3)


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_planned_stroke_is_within_all_limits(label: PaperLabel) -> None:
    stroke = planned_strokes()[label]
    speed, acceleration = stroke.peak_fractions(ROBOT.limits)
    assert speed.max() <= 0.9
    assert acceleration.max() <= 0.9
    assert stroke.start_time_s > 0.2, "the first look at the ball comes before the swing"
    assert stroke.end_time_s <= 1.30
    states = stroke.sample(np.arange(0.0, 1.4, 0.01))
    assert (states.position > POSITION_LOWER_RAD + 0.1).all()
    assert (states.position < POSITION_UPPER_RAD - 0.1).all()
    assert np.abs(states.position[:, 0]).max() < 1.3
    assert states.position[:, 1].min() > -1.9
    assert states.position[:, 1].max() < 0.9
    for joints in states.position:
        centre, rotation = paddle_pose(ARM, joints)
        edge = centre[2] - BLADE_RADIUS_M * np.sqrt(1.0 - rotation[2, 1] ** 2)
        if centre[0] > -Scene().table.length_m / 2.0 - 2.0 * BLADE_RADIUS_M:
            assert edge > Scene().table.height_m + 0.05


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_planned_hit_is_with_the_sides_own_face(label: PaperLabel) -> None:
    path = feed_path(Feeder().nominal(label.side), SCENE)
    done = carry_out(
        ARM, _hit_of(planned_strokes()[label]), face_sign(label.side), path, PATH_PERIOD_S, SCENE
    )
    assert done.normal[0] > 0.5, "the striking face looks to the far half"
    assert done.approach > 1.0
    assert np.linalg.norm(done.off_centre) < 0.005


def test_ready_poses_are_reached_clear_of_table_and_arm() -> None:
    rests = [HOME_POSTURE_RAD, *(planned_strokes()[label].start.position for label in ALL_LABELS[::3])]
    for start in rests:
        for goal in rests:
            assert room_on_path(ROBOT, start, goal) > 0.03


def test_planned_strokes_return_the_nominal_feed_with_their_spin() -> None:
    results = _play_open_loop(NO_SPREAD, 1)
    assert results.returned.all()
    for index, label in enumerate(ALL_LABELS):
        low, high = SPIN_RANGES[label.stroke]
        spin = results.spin[index, 0, 1]
        assert low <= spin <= high, label
        wanted = Strategies.shipped().of(label).spin
        assert wanted is not None
        assert wanted.distance(spin) == 0.0
        np.testing.assert_allclose(results.landing[index, 0], PlannerConfig().landing_m, atol=0.1)


def test_planned_strokes_forgive_small_errors() -> None:
    assert _play_open_loop(EASY, 60).returned.mean(axis=1).min() > 0.95
    standard = _play_open_loop(STANDARD, 60).returned.mean(axis=1)
    assert standard.min() > 0.5
    assert standard.max() < 0.97, "what has to be learned is to answer the ball"


def test_planner_finds_its_way_back_to_the_kept_strokes() -> None:
    """The kept plan solves the problem it came from: from a start 0.05 rad off, the solver comes back."""
    side, config = Side.FOREHAND, PlannerConfig()
    problem = SideProblem(ROBOT, side, config, feed_path(Feeder().nominal(side), SCENE), SCENE)
    strokes = [planned_strokes()[label] for label in problem.labels]
    kept = np.concatenate([strokes[0].start.position, *(_hit_of(stroke) for stroke in strokes)])
    cost = 0.5 * np.sum(problem.residuals(kept) ** 2)
    assert cost < 3.0
    off = kept + 0.05 * np.random.default_rng(4).uniform(-1.0, 1.0, kept.shape)
    off[[7, 22, 37]] = kept[[7, 22, 37]]
    found, again = problem.solve(off, evaluations=40)
    assert again < cost + 0.2
    np.testing.assert_allclose(found[:7], kept[:7], atol=0.15)


# -- what is refused -------------------------------------------------------------------------------------


def _strokes_of(side: Side) -> dict[PaperLabel, JointStroke]:
    return {label: stroke for label, stroke in planned_strokes().items() if label.side is side}


def _fault(
    strokes: dict[PaperLabel, JointStroke], cost: float = 1.0, home: np.ndarray = HOME_POSTURE_RAD
) -> str:
    return find_fault(ROBOT, strokes, cost, [home], Scene(), Feeder())


def test_kept_strokes_have_no_fault_and_costly_plans_do() -> None:
    strokes = _strokes_of(Side.FOREHAND)
    assert _fault(strokes) == ""
    assert _fault(strokes, MOST_COST) == ""
    assert "cost 10.1, at most 10" in _fault(strokes, MOST_COST + 0.1)


def test_strokes_that_miss_their_ball_are_named() -> None:
    strokes = _strokes_of(Side.BACKHAND)
    label = PaperLabel(Side.BACKHAND, Stroke.SLICE)
    late = replace(strokes[label], hit_time_s=strokes[label].hit_time_s + 0.2)
    assert "planned backhand-slice played as planned does not return" in _fault({**strokes, label: late})


def test_ready_poses_behind_the_table_are_refused() -> None:
    through_the_table = HOME_POSTURE_RAD.copy()
    through_the_table[[1, 3]] = 1.0, -1.0
    assert "not reached clear of table and arm" in _fault(_strokes_of(Side.FOREHAND), home=through_the_table)


def test_where_no_posture_is_found_the_error_says_what_to_change() -> None:
    config = PlannerConfig(searches=0)
    with pytest.raises(
        UserError, match=r"no forehand strokes: no posture found .*; move `base` in robot\.yaml"
    ):
        plan_side(ROBOT, Side.FOREHAND, config, Scene(), Feeder(), [HOME_POSTURE_RAD])


def test_hits_in_singular_postures_cost() -> None:
    for name in ("sawyer", "ur10e"):
        robot = load_robot(name)
        for label, stroke in planned_strokes(robot).items():
            assert singular_residual(robot.model, stroke.hit_position) == 0.0, (name, label)
        assert singular_residual(robot.model, np.zeros(robot.joint_count)) > 1.0


def test_kept_strokes_are_where_a_plan_may_begin(tmp_path: Path) -> None:
    kept = kept_strokes(ROBOT)
    assert kept is not None
    config = PlannerConfig(searches=0)
    planned = plan_side(ROBOT, Side.FOREHAND, config, Scene(), Feeder(), [HOME_POSTURE_RAD], kept)
    for label, stroke in planned.items():
        np.testing.assert_allclose(stroke.start.position, kept[label].start.position, atol=0.1)
    assert kept_strokes(replace(ROBOT, folder=tmp_path)) is None


def test_kept_strokes_read_back(tmp_path: Path) -> None:
    robot = replace(ROBOT, folder=tmp_path)
    write_strokes(robot, planned_strokes(), tmp_path / PLAN_FILE)
    for label, stroke in planned_strokes(robot).items():
        np.testing.assert_allclose(stroke.hit_velocity, planned_strokes()[label].hit_velocity, atol=1e-6)
        assert stroke.start_time_s == pytest.approx(planned_strokes()[label].start_time_s, abs=1e-5)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("backhand-slice:", "backhand-lob:"),
        ("hit_time_s: ", "hit_time_s: soon "),
        ("planned_for: ", "planned_for: 0"),
        ("forehand-push:", "forehand-push: ["),
        ("ready_position: [", "ready_position: [0.0, "),
    ],
)
def test_unusable_kept_strokes_are_named_with_the_command_that_makes_them(
    tmp_path: Path, old: str, new: str
) -> None:
    text = (ROBOT.folder / PLAN_FILE).read_text()
    assert old in text
    (tmp_path / PLAN_FILE).write_text(text.replace(old, new, 1))
    with pytest.raises(UserError, match=rf"{PLAN_FILE}.*msrd_ros plan {tmp_path}"):
        planned_strokes(replace(ROBOT, folder=tmp_path))


def test_kept_strokes_of_a_newer_format_are_refused(tmp_path: Path) -> None:
    write_strokes(ROBOT, planned_strokes(), tmp_path / PLAN_FILE)
    text = (tmp_path / PLAN_FILE).read_text()
    assert "\nformat: 1\n" in text
    (tmp_path / PLAN_FILE).write_text(text.replace("\nformat: 1\n", "\nformat: 2\n"))
    with pytest.raises(UserError, match=rf"{PLAN_FILE}: is of format 2, .* upgrade msrd_ros"):
        planned_strokes(replace(ROBOT, folder=tmp_path))


def test_strokes_of_an_arm_with_other_limits_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "arm"
    shutil.copytree(ROBOT.folder, folder)
    sheet = (folder / "robot.yaml").read_text()
    (folder / "robot.yaml").write_text(sheet.replace("speed_rad_s: [1.74", "speed_rad_s: [1.70"))
    with pytest.raises(UserError, match="planned for the arm as it was"):
        planned_strokes(load_robot(folder))
