"""A stroke guided on a page: the ball comes in slow motion, a person drags the paddle, the arm follows."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.robots.inverse_kinematics import joint_rates_for_twist
from msrd_ros.robots.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import quaternion_from_rotation, turn_between, turned
from msrd_ros.studio.views import rounded
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.impedance_guidance import leading_wrench
from msrd_ros.table_tennis.teachers.sketch_plan import PLAN_PERIOD_S, SketchPlan
from msrd_ros.table_tennis.teachers.violations import Violation, reach

Array = NDArray[np.float64]

SILENCE_S = 0.5
"""A page that has not told of its pointer for so long has let go of the paddle."""
HASTE_1_S = 30.0
"""How eagerly the hand follows the pointer."""
FASTEST_M_S, HARDEST_M_S2 = 2.5, 40.0
DISC_M = 0.1
"""A pointer so near the pacer has the hand go along with it: between two moves of a mouse a hand flows."""
AHEAD_S = 0.05
"""By so much the pacer goes ahead of the paddle: hand and arm come after the pointer."""
LONGEST_TICK_S = 0.02
_FLIES_M = 0.02
_BLINK_S = 1e-3
_DAMPING = 0.05
_STRIDE = 10
"""Every so many rows of the plan are looked at."""
_UP = np.array([0.0, 0.0, 1.0])


class GuidedPlane:
    """Where the paddle can be dragged: a vertical plane through the contact, along the sketched stroke.

    How the paddle is turned, and how far it is beside the plane, follows from how far along it is, as in the
    sketch: a pointer has two directions for six.

    Parameters
    ----------
    robot
        The arm, of N joints.
    plan
        Of the sketch that shows the way.
    """

    def __init__(self, robot: Robot, plan: SketchPlan) -> None:
        hit = round(plan.stroke.hit_time_s / PLAN_PERIOD_S)
        velocity = plan.paddle[hit, 6:8]
        along = velocity if np.linalg.norm(velocity) > 1e-3 else np.array([1.0, 0.0])
        self.origin = plan.sketch.contact.position
        self.along = np.array([*(along / np.linalg.norm(along)), 0.0])
        self.across = np.cross(_UP, self.along)
        rows = np.arange(hit % _STRIDE, len(plan.paddle), _STRIDE)
        way = plan.paddle[rows, :3] - self.origin
        # What goes back, as to wind up, is left out: one place along the way is one pose.
        self._along, first = np.unique(np.maximum.accumulate(way @ self.along), return_index=True)
        self._beside = (way @ self.across)[first]
        postures = plan.states.position[rows[first]]
        self._rotations = [paddle_pose(robot.model, posture)[1] for posture in postures]

    def inside(self, position: Array) -> Array:
        """How far along and how high above the contact a position (3,) is, shape (2,), m."""
        way = position - self.origin
        return np.array([way @ self.along, way[2]])

    def pose(self, place: Array) -> tuple[Array, Array]:
        """Position (3,) and rotation (3, 3) of the paddle at a place (2,) of the plane."""
        index = float(np.interp(place[0], self._along, np.arange(len(self._along))))
        row = min(int(index), len(self._along) - 2)
        turn = turn_between(self._rotations[row], self._rotations[row + 1])
        beside = float(np.interp(place[0], self._along, self._beside))
        position = self.origin + place[0] * self.along + place[1] * _UP + beside * self.across
        return position, turned(self._rotations[row], (index - row) * turn)


class DraggedStroke:
    """A person's hand on the paddle, led by a pointer on a page.

    The hand goes after the pointer no faster than a hand does, and not beyond where the arm reaches. It lets
    go when the page says so, or says nothing for `SILENCE_S`.

    Parameters
    ----------
    robot
        The arm, of N joints.
    plan
        Of the sketch that shows the way; the arm waits in its wind-up.
    """

    def __init__(self, robot: Robot, plan: SketchPlan) -> None:
        self._robot, self._plan = robot, plan
        self._grip = GuidanceConfig()
        self.plane = GuidedPlane(robot, plan)
        self._joints = plan.states.position[0]
        self._goal: Array | None = None
        self._offset: Array | None = None
        self._heard_s = 0.0
        self._place = self._velocity = np.zeros(2)
        self._time_s = 0.0
        self._holds = False
        self._ball: Array | None = None
        self._launched_s: float | None = None
        self.beyond: list[Violation] = []

    @property
    def ready_posture(self) -> Array:
        """Joint angles (N,) in rad of the wind-up."""
        posture: Array = self._plan.states.position[0]
        return posture

    @property
    def holds(self) -> bool:
        """Whether the hand has the paddle."""
        return self._goal is not None and time.monotonic() - self._heard_s <= SILENCE_S

    def drag(self, along_m: float, up_m: float) -> None:
        """The pointer is there; what the arm does not reach is told in `beyond`, and not gone to."""
        self._heard_s = time.monotonic()
        place = np.array([along_m, up_m])
        _, self.beyond = reach(self._robot, *self.plane.pose(place), [self._joints, self.ready_posture])
        self._offset = None if self.beyond else _beside(place - self._pacer)
        if self._goal is None:
            self._goal = self._here

    def release(self) -> None:
        """Let go of the paddle."""
        self._goal, self._offset, self.beyond = None, None, []

    @property
    def _here(self) -> Array:
        return self.plane.inside(paddle_pose(self._robot.model, self._joints)[0])

    def see(self, stamp_s: float, position: Array) -> None:
        """Take in where the ball is; from the moment it flies the pacer goes."""
        before, self._ball = self._ball, position
        flies = before is not None and float(np.linalg.norm(position - before)) > _FLIES_M
        if self._launched_s is None and flies:
            self._launched_s = stamp_s

    def hand_at(self, time_s: float, joint_position: Array) -> HandGesture | None:
        """Where the hand is now; None while it does not hold the paddle."""
        self._joints = joint_position
        period_s, self._time_s = min(max(time_s - self._time_s, 0.0), LONGEST_TICK_S), time_s
        if not self.holds:
            self.release()
            self._holds = False
            return None
        assert self._goal is not None
        if not self._holds:
            self._holds, self._place, self._velocity = True, self._here, np.zeros(2)
        if self._offset is not None:
            self._goal = self._pacer + self._offset
        wanted = HASTE_1_S * (self._goal - self._place)
        wanted *= min(1.0, FASTEST_M_S / max(float(np.linalg.norm(wanted)), 1e-9))
        change, most = wanted - self._velocity, HARDEST_M_S2 * period_s
        self._velocity = self._velocity + change * min(1.0, most / max(float(np.linalg.norm(change)), 1e-9))
        self._place = self._place + period_s * self._velocity
        position, rotation = self.plane.pose(self._place)
        next_position, next_rotation = self.plane.pose(self._place + _BLINK_S * self._velocity)
        twist = np.concatenate([next_position - position, turn_between(rotation, next_rotation)]) / _BLINK_S
        push, turn = self._lead_for(twist)
        return HandGesture.now(
            position + push, quaternion_from_rotation(turned(rotation, turn)), twist[:3], twist[3:]
        )

    def _lead_for(self, twist: Array) -> tuple[Array, Array]:
        """How far a hand runs ahead, (3,) in m and (3,) in rad, of the paddle at a twist (6,)."""
        model, still = self._robot.model, np.zeros(self._robot.joint_count)
        rates = joint_rates_for_twist(paddle_jacobian(model, self._joints), twist, still, _DAMPING)
        resistance = np.array(self._robot.floating.joint_damping_nm_s)
        wrench = leading_wrench(model, self._joints, rates, still, resistance)
        return wrench[:3] / self._grip.stiffness_n_m, wrench[3:] / self._grip.turn_stiffness_nm

    @property
    def _pacer(self) -> Array:
        """Where the sketched stroke would be about now, (2,) in the plane."""
        paddle = self._plan.paddle
        since_s = 0.0 if self._launched_s is None else self._time_s - self._launched_s + AHEAD_S
        row = min(max(round(since_s / PLAN_PERIOD_S), 0), len(paddle) - 1)
        return self.plane.inside(paddle[row, :3])

    def told(self) -> dict[str, Any]:
        """Where paddle and ball are in the plane, and what is out of reach, as JSON has it."""
        ball = None if self._ball is None else self.plane.inside(self._ball)
        return {
            "pacer": rounded(self._pacer),
            "paddle": rounded(self._here),
            "ball": None if ball is None else rounded(ball),
            "holds": self.holds,
            "beyond": [str(violation) for violation in self.beyond],
        }


def _beside(way: Array) -> Array:
    """How far beside the pacer a pointer means to lead the hand, (2,) in m: not at all while on its disc."""
    size = float(np.linalg.norm(way))
    return way * min(max(2.0 * (size - DISC_M), 0.0), size) / max(size, DISC_M)


def guide_view(robot: Robot, plan: SketchPlan) -> dict[str, Any]:
    """What the page draws beneath: ghosts, the coming ball and the table's edge in the plane, in m."""
    plane = GuidedPlane(robot, plan)
    ball = plan.prediction.path[: round(plan.stroke.hit_time_s / PLAN_PERIOD_S) + 1 : 12, :3]
    return {
        "ball_path": [rounded(plane.inside(row)) for row in ball],
        "ghosts": {
            str(moment): rounded(plane.inside(ghost.position)) for moment, ghost in plan.sketch.ghosts.items()
        },
    }
