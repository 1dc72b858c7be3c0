"""Plans of sketches: through the ghosts, within limits or told which not, with the ball after the hit."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from drawn_sketches import ARMS, SPINS_RAD_S, drawn
from msrd_ros.contract.outcome import MissReason
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import turn_between
from msrd_ros.table_tennis.arm.via_point_path import room
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.default_sketch import default_sketch
from msrd_ros.table_tennis.teachers.side import face_sign
from msrd_ros.table_tennis.teachers.sketch import Ghost, Moment, Sketch
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan, plan_sketch
from msrd_ros.table_tennis.teachers.violations import Limit, check_pose

pytestmark = pytest.mark.slow

CASES = [(arm, side) for arm in ARMS for side in Side]
FINE_S = 0.001
INTERACTIVE_S = 0.1


def _plan(arm: str, sketch: Sketch) -> SketchPlan:
    return plan_sketch(load_robot(arm), sketch)


def _limits(plan: SketchPlan) -> set[Limit]:
    return {violation.limit for violation in plan.violations}


@pytest.mark.parametrize("motion", SPINS_RAD_S)
@pytest.mark.parametrize(("arm", "side"), CASES)
def test_a_default_sketch_is_possible_and_returns_its_ball(arm: str, side: Side, motion: str) -> None:
    plan = _plan(arm, drawn(arm, side, motion))
    outcome = plan.prediction.outcome
    assert plan.violations == ()
    plan.require_possible()
    assert outcome.returned
    assert plan.face == face_sign(side)
    assert outcome.hit_time_s == pytest.approx(plan.sketch.contact_s, abs=0.005)
    assert outcome.spin_y_rad_s == pytest.approx(SPINS_RAD_S[motion], abs=25.0)
    np.testing.assert_allclose([outcome.landing_x_m, outcome.landing_y_m], [0.75, 0.0], atol=0.35)


@pytest.mark.parametrize(("arm", "side"), CASES)
def test_the_paddle_is_at_each_ghost_when_the_plan_says_so(arm: str, side: Side) -> None:
    plan = _plan(arm, drawn(arm, side))
    for moment, ghost in plan.sketch.ghosts.items():
        state = plan.stroke.at(plan.moments_s[moment])
        position, rotation = paddle_pose(load_robot(arm).model, state.position)
        np.testing.assert_allclose(position, ghost.position, atol=1.1e-3)
        assert np.linalg.norm(turn_between(rotation, ghost.rotation)) < 6e-3
        if moment is not Moment.CONTACT:
            assert np.abs(state.velocity).max() < 1e-9


def test_the_paddle_of_the_plan_moves_as_it_says() -> None:
    plan = _plan("sawyer", drawn("sawyer", Side.FOREHAND))
    moved = np.diff(plan.paddle[:, :3], axis=0) / FINE_S
    mean = 0.5 * (plan.paddle[1:, 6:9] + plan.paddle[:-1, 6:9])
    np.testing.assert_allclose(moved, mean, atol=1e-3)


@pytest.mark.parametrize("arm", ARMS)
def test_more_time_makes_a_slower_hit(arm: str) -> None:
    sketch = drawn(arm, Side.FOREHAND)
    usual = _plan(arm, sketch)
    assert sketch.swing_s is not None
    assert sketch.follow_s is not None
    slow = _plan(arm, replace(sketch, swing_s=2.0 * sketch.swing_s, follow_s=2.0 * sketch.follow_s))
    speeds = [np.linalg.norm(plan.hit.paddle_velocity) for plan in (usual, slow)]
    assert speeds[1] == pytest.approx(0.5 * speeds[0], rel=0.02)


@pytest.mark.parametrize("arm", ARMS)
def test_durations_that_nobody_gives_are_within_the_limits(arm: str) -> None:
    sketch = replace(drawn(arm, Side.FOREHAND), swing_s=None, follow_s=None)
    assert not _limits(_plan(arm, sketch)) & {Limit.SPEED, Limit.ACCELERATION, Limit.POSITION}


def test_a_plan_takes_less_than_a_tenth_of_a_second() -> None:
    sketch = drawn("sawyer", Side.FOREHAND)
    taken = []
    for index in range(10):
        moved = replace(sketch, contact=sketch.contact.moved(np.array([0.0, 0.002 * index, 0.0])))
        begin = time.perf_counter()
        _plan("sawyer", moved)
        taken.append(time.perf_counter() - begin)
    # The least of some: other processes take their share of the machine.
    assert min(taken) < INTERACTIVE_S


# -- what the arm cannot do --------------------------------------------------------------------------------


def test_too_fast_names_the_joints_and_by_how_much() -> None:
    robot, sketch = load_robot("sawyer"), drawn("sawyer", Side.FOREHAND)
    plan = plan_sketch(robot, replace(sketch, swing_s=0.12, follow_s=0.12))
    fast = [each for each in plan.violations if each.limit is Limit.SPEED]
    assert fast
    for each in fast:
        index = robot.joint_names.index(each.joint)
        most = robot.floating.brake_from * robot.limits.speed_rad_s[index]
        assert each.excess == pytest.approx(np.abs(plan.states.velocity[:, index]).max() - most)
        assert each.unit == "rad/s"
        assert each.ghost in list(Moment)
        assert each.joint in str(each)
    with pytest.raises(UserError, match=r"my-push-like.*more time"):
        plan.require_possible()


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("moment", list(Moment))
def test_too_far_tells_which_ghost_and_by_how_much(arm: str, moment: Moment) -> None:
    robot, sketch = load_robot(arm), drawn(arm, Side.FOREHAND)
    ghost = sketch.ghosts[moment].moved(np.array([1.5, 0.0, 0.5]))
    plan = plan_sketch(robot, sketch.with_ghosts({moment: ghost}))
    missed = [each for each in plan.violations if each.limit is Limit.REACH and each.unit == "m"]
    assert [each.ghost for each in missed] == [moment]
    assert missed[0] is plan.violations[0], "what else follows from it comes later"
    assert missed[0].time_s == pytest.approx(plan.moments_s[moment])
    there, _ = paddle_pose(robot.model, plan.stroke.at(plan.moments_s[moment]).position)
    assert missed[0].excess == pytest.approx(np.linalg.norm(ghost.position - there), abs=1e-6)
    # It cannot be nearer than the sphere that the blade never leaves.
    assert missed[0].excess >= np.linalg.norm(ghost.position - robot.shoulder) - robot.reach_m


@pytest.mark.parametrize("arm", ARMS)
def test_through_the_table_is_told(arm: str) -> None:
    sketch = drawn(arm, Side.FOREHAND)
    x, y, _ = sketch.follow_through.position_m
    low = replace(sketch.follow_through, position_m=(max(x, -1.3), y, 0.78))
    plan = _plan(arm, replace(sketch, follow_through=low, follow_s=0.6))
    into = [each for each in plan.violations if each.limit is Limit.TABLE]
    assert len(into) == 1
    assert into[0].joint == ""
    assert into[0].excess > 0.02


@pytest.mark.parametrize("arm", ARMS)
def test_a_dragged_pose_is_judged_at_once(arm: str) -> None:
    robot, contact = load_robot(arm), drawn(arm, Side.FOREHAND).contact
    near = _plan(arm, drawn(arm, Side.FOREHAND)).stroke.hit_position
    joints, fine = check_pose(robot, contact.position, contact.rotation, near)
    assert fine == []
    np.testing.assert_allclose(paddle_pose(robot.model, joints)[0], contact.position, atol=1e-3)
    _, far = check_pose(robot, contact.moved(np.array([2.0, 0.0, 0.0])).position, contact.rotation, near)
    assert far[0].limit is Limit.REACH
    assert far[0].excess > 1.0
    low = np.array([-1.3, -0.3, 0.76])
    _, crowded = check_pose(robot, low, contact.rotation, near)
    assert Limit.TABLE in {each.limit for each in crowded}


def test_a_pose_beyond_a_joints_limit_names_the_joint() -> None:
    robot = load_robot("ur10e")
    beyond = robot.home_rad.copy()
    beyond[-1] = robot.limits.highest_rad[-1] + 0.2
    near = np.minimum(beyond, robot.limits.highest_rad)
    _, found = check_pose(robot, *paddle_pose(robot.model, beyond), near)
    assert [(each.limit, each.joint) for each in found] == [(Limit.POSITION, "wrist_3_joint")]
    assert found[0].excess == pytest.approx(0.2, abs=0.01)


def test_a_foreign_ready_posture_is_refused() -> None:
    sketch = drawn("sawyer", Side.FOREHAND)
    with pytest.raises(UserError, match="ready_rad has 6"):
        _plan("sawyer", replace(sketch, ready_rad=(0.0,) * 6))
    with pytest.raises(UserError, match="right_j3"):
        _plan("sawyer", replace(sketch, ready_rad=(0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0)))


def test_a_stroke_that_nobody_can_play_is_refused_with_what_to_ask_for() -> None:
    with pytest.raises(UserError, match="less spin"):
        default_sketch(load_robot("sawyer"), Side.FOREHAND, spin_y_rad_s=900.0)


# -- what the ball does -----------------------------------------------------------------------------------


def test_a_paddle_elsewhere_misses_and_says_by_how_much() -> None:
    sketch = drawn("sawyer", Side.FOREHAND)
    aside = replace(sketch, contact=sketch.contact.moved(np.array([0.0, 0.25, 0.0])))
    plan = _plan("sawyer", aside)
    assert not plan.prediction.outcome.struck
    assert plan.prediction.outcome.miss_reason is MissReason.MISSED
    assert plan.off_centre_m == pytest.approx(0.25, abs=0.02)


def test_a_blade_turned_down_plays_into_net_or_table() -> None:
    sketch = drawn("sawyer", Side.FOREHAND)
    tilt = np.array([[np.cos(0.6), 0.0, np.sin(0.6)], [0.0, 1.0, 0.0], [-np.sin(0.6), 0.0, np.cos(0.6)]])
    contact = Ghost.of(sketch.contact.position, tilt @ sketch.contact.rotation)
    outcome = _plan("sawyer", replace(sketch, contact=contact)).prediction.outcome
    assert outcome.struck
    assert outcome.miss_reason in (MissReason.NET, MissReason.OWN_HALF)


def test_the_predicted_ball_turns_round_at_the_contact() -> None:
    times, path, outcome = _plan("sawyer", drawn("sawyer", Side.FOREHAND)).prediction
    before, after = path[times < outcome.hit_time_s], path[times > outcome.hit_time_s]
    assert before[-1, 3] < 0.0 < after[0, 3]
    assert len(times) == len(path)
    landing = after[np.argmin(np.hypot(after[:, 0] - outcome.landing_x_m, after[:, 1] - outcome.landing_y_m))]
    assert landing[2] < 0.80


# -- what no violation means ---------------------------------------------------------------------------------

SHIFTS = st.floats(-0.08, 0.08)


def _keeps_all_limits(robot: Robot, plan: SketchPlan, offset_s: float) -> None:
    """Between the samples that the plan was checked at, too."""
    states = plan.stroke.sample(np.arange(offset_s, plan.stroke.end_time_s, FINE_S))
    limits, small = robot.limits, 1e-3
    assert (states.position >= limits.lowest_rad - small).all()
    assert (states.position <= limits.highest_rad + small).all()
    assert (np.abs(states.velocity) <= limits.speed_rad_s).all()
    assert (np.abs(states.acceleration) <= limits.acceleration_rad_s2 * (1.0 + small)).all()
    assert min(room(robot, joints) for joints in states.position[::10]) >= 0.0, "arm and table"


@settings(max_examples=40)
@given(
    case=st.sampled_from(CASES),
    shift=st.tuples(SHIFTS, SHIFTS, SHIFTS),
    moved=st.sampled_from(Moment),
    swing_s=st.one_of(st.none(), st.floats(0.2, 0.6)),
    follow_s=st.one_of(st.none(), st.floats(0.2, 0.6)),
    offset_s=st.floats(0.0, FINE_S),
)
def test_a_plan_without_violations_keeps_all_limits(
    case: tuple[str, Side],
    shift: tuple[float, float, float],
    moved: Moment,
    swing_s: float | None,
    follow_s: float | None,
    offset_s: float,
) -> None:
    arm, side = case
    sketch = drawn(arm, side)
    shifted = sketch.with_ghosts({moved: sketch.ghosts[moved].moved(np.array(shift))})
    plan = _plan(arm, replace(shifted, swing_s=swing_s, follow_s=follow_s))
    # Too few of them would fail as well.
    assume(not plan.violations)
    _keeps_all_limits(load_robot(arm), plan, offset_s)
