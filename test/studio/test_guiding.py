"""A hand on the paddle: it goes after the pointer, no faster than a hand, no further than the arm reaches."""

from __future__ import annotations

import time

import numpy as np
import pytest

from drawn_sketches import drawn
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.studio import guiding
from msrd_ros.studio.guiding import FASTEST_M_S, DraggedStroke, GuidedPlane
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.sketch import Moment
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan, plan_sketch
from sawyer import ROBOT

TICK_S = 0.004


@pytest.fixture(scope="module", params=list(Side))
def plan(request: pytest.FixtureRequest) -> SketchPlan:
    return plan_sketch(ROBOT, drawn("sawyer", request.param))


def test_the_plane_leads_through_the_ghosts(plan: SketchPlan) -> None:
    plane = GuidedPlane(ROBOT, plan)
    for moment in Moment:
        ghost = plan.sketch.ghosts[moment]
        position, rotation = plane.pose(plane.inside(ghost.position))
        exact = moment is Moment.CONTACT
        np.testing.assert_allclose(position, ghost.position, atol=1e-3 if exact else 0.01)
        np.testing.assert_allclose(rotation, ghost.rotation, atol=2e-3 if exact else 0.02)


def test_nobody_holds_the_paddle_before_it_is_taken_and_after_it_is_let_go(plan: SketchPlan) -> None:
    stroke = DraggedStroke(ROBOT, plan)
    assert stroke.hand_at(1.0, stroke.ready_posture) is None
    stroke.drag(*stroke.plane.inside(plan.sketch.wind_up.position))
    assert stroke.holds
    assert stroke.hand_at(1.0, stroke.ready_posture) is not None
    stroke.release()
    assert stroke.hand_at(1.1, stroke.ready_posture) is None


def test_a_silent_page_has_let_go(plan: SketchPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    stroke = DraggedStroke(ROBOT, plan)
    stroke.drag(*stroke.plane.inside(plan.sketch.wind_up.position))
    later_s = time.monotonic() + guiding.SILENCE_S + 0.01
    monkeypatch.setattr(time, "monotonic", lambda: later_s)
    assert not stroke.holds
    assert stroke.hand_at(1.0, stroke.ready_posture) is None


def test_the_hand_goes_to_the_pointer_at_a_hands_speed(plan: SketchPlan) -> None:
    stroke = DraggedStroke(ROBOT, plan)
    start = paddle_pose(ROBOT.model, stroke.ready_posture)[0]
    places = []
    for tick in range(250):
        stroke.drag(0.0, 0.0)
        hand = stroke.hand_at(1.0 + tick * TICK_S, stroke.ready_posture)
        assert hand is not None
        places.append(hand.positions[0])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    np.testing.assert_allclose(places[0], start, atol=0.02)
    np.testing.assert_allclose(places[-1], plan.sketch.contact.position, atol=1e-3)
    assert steps.max() <= 1.5 * FASTEST_M_S * TICK_S


def test_what_the_arm_does_not_reach_is_told_and_not_gone_to(plan: SketchPlan) -> None:
    stroke = DraggedStroke(ROBOT, plan)
    for tick in range(250):
        stroke.drag(0.0, 0.0)
        stroke.hand_at(tick * TICK_S, stroke.ready_posture)
    assert stroke.told()["beyond"] == []
    stroke.drag(1.4, 0.6)
    assert "reach missed by" in stroke.told()["beyond"][0] or "passed by" in stroke.told()["beyond"][0]
    for tick in range(250):
        stroke.drag(1.4, 0.6)
        hand = stroke.hand_at(1.0 + tick * TICK_S, stroke.ready_posture)
    assert hand is not None
    np.testing.assert_allclose(hand.positions[0], plan.sketch.contact.position, atol=1e-3)


def test_the_pacer_goes_with_the_ball(plan: SketchPlan) -> None:
    stroke, plane = DraggedStroke(ROBOT, plan), GuidedPlane(ROBOT, plan)
    ball = np.array(plan.sketch.feed.position)
    stroke.see(1.0, ball)
    stroke.hand_at(1.0, stroke.ready_posture)
    np.testing.assert_allclose(stroke.told()["pacer"], plane.inside(plan.sketch.wind_up.position), atol=0.02)
    stroke.see(2.0, ball - 0.03)
    stroke.hand_at(2.0 + plan.stroke.hit_time_s - guiding.AHEAD_S, stroke.ready_posture)
    np.testing.assert_allclose(stroke.told()["pacer"], [0.0, 0.0], atol=0.02)
