"""From a sketch to the motion of the arm, what of it the arm cannot do, and what the ball will do.

The joints go from rest in the wind-up through the contact to rest in the follow-through on the smoothest
(minimum-jerk) way, so how fast the paddle meets the ball follows from where the ghosts are and when.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.core.errors import UserError
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import place_moving_paddle
from msrd_ros.robots.quintic import JointState, JointStroke, minimum_jerk_velocity, stroke_from_rest
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.prediction import Prediction, predict_rally
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.surfaces import PADDLE_SIZE
from msrd_ros.table_tennis.ball.trajectory import path_at
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig
from msrd_ros.table_tennis.teachers.hit_solver import Hit, carry_out
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, feed_path
from msrd_ros.table_tennis.teachers.sketch import LONGEST_S, Moment, Sketch, variation
from msrd_ros.table_tennis.teachers.violations import Violation, check_motion, reach

Array = NDArray[np.float64]

PLAN_PERIOD_S = 0.001
"""Of the motion's samples: limits are checked and the ball is flown at it."""

_COMFORTABLE_SPEED, _COMFORTABLE_ACCELERATION = 0.75, 0.35
"""Shares of the limits that a duration is chosen for where the sketch does not say."""
_SHORTEST_S = 0.25
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735
"""Of the minimum-jerk way from rest to rest, over its length by its duration, or the square of it."""
_NEAR_RAD = 1e-3
_MOST_DRAWS = 20
_OTHER_STARTS = 8


@dataclass(frozen=True, eq=False)
class SketchPlan:
    """What comes of a sketch. Times in s since the ball's launch, everything else SI in `world`.

    Attributes
    ----------
    sketch
        As drawn.
    stroke
        Motion of the joints, through the nearest that the arm gets where a ghost is out of reach.
    face
        +1 where the front face meets the ball, -1 where the back face does.
    times_s
        From the launch to the end of the follow-through, shape (T,), `PLAN_PERIOD_S` apart.
    states
        Of the joints there, shape (T, N) each.
    paddle
        There: blade's centre, normal, velocity and angular velocity, shape (T, 12).
    violations
        Why the arm cannot do it: ghosts out of reach, then limits on the way; empty if it can.
    prediction
        The ball's path through the hit, and what becomes of it.
    hit
        What happens at the contact if the ball is met in the middle: face, ball before and after.
    """

    sketch: Sketch
    stroke: JointStroke
    face: float
    times_s: Array
    states: JointState
    paddle: Array
    violations: tuple[Violation, ...]
    prediction: Prediction
    hit: Hit

    @property
    def moments_s(self) -> dict[str, float]:
        """When the paddle is at each ghost, by `Moment`."""
        return _moments(self.stroke)

    @property
    def off_centre_m(self) -> float:
        """How far from the middle of the face the ball is at the contact."""
        return float(np.linalg.norm(self.hit.off_centre))

    def require_possible(self) -> None:
        """Refuse what the arm cannot do.

        Raises
        ------
        UserError
            If there is a violation; tells the first, and how many more there are.
        """
        if self.violations:
            more = f" and {len(self.violations) - 1} more" if len(self.violations) > 1 else ""
            raise UserError(
                f"sketch {self.sketch.strategy}: {self.violations[0]}{more}; move the ghosts or give them "
                "more time"
            )


def plan_sketch(
    robot: Robot, sketch: Sketch, scene: Scene | None = None, grip: GuidanceConfig | None = None
) -> SketchPlan:
    """Plan a sketched stroke and predict its ball; nothing moves.

    Parameters
    ----------
    robot
        The arm, of N joints.
    sketch
        What is wanted of it.
    scene, grip
        Table and ball, and the hand that will lead the arm; the standard ones if None.

    Raises
    ------
    UserError
        If the sketch's ready posture is not one of this arm.
    """
    scene = scene or Scene()
    constants = scene.constants()
    postures, unreached = _postures(robot, sketch)
    stroke = _stroke(robot, sketch, postures)
    rows = round(stroke.end_time_s / PLAN_PERIOD_S) + 2
    times = np.arange(rows, dtype=np.float64) * PLAN_PERIOD_S
    states = stroke.sample(times)
    paddle = _paddles(robot.model, states.position, states.velocity)
    moments = _moments(stroke)
    found = [replace(each, time_s=moments[each.ghost]) for each in unreached]
    found += check_motion(robot, times, states, moments, scene.table, grip)
    path = feed_path(sketch.feed, constants)
    face = _face(sketch, path)
    rates = stroke.hit_velocity / robot.limits.speed_rad_s
    hit = np.concatenate([[stroke.hit_time_s], stroke.hit_position, rates])
    return SketchPlan(
        sketch,
        stroke,
        face,
        times,
        states,
        paddle,
        tuple(found),
        predict_rally(sketch.feed.state(), paddle, PLAN_PERIOD_S, constants),
        carry_out(robot.model, hit, face, path, PATH_PERIOD_S, constants),
    )


def plan_variation(
    robot: Robot,
    sketch: Sketch,
    rng: np.random.Generator,
    timing_s: float = 0.01,
    tempo: float = 0.05,
    scene: Scene | None = None,
    refused: Callable[[SketchPlan], None] = lambda plan: None,
) -> SketchPlan:
    """A plan without violations of the same stroke as its person would do it another time; see `variation`.

    `refused` is told of each variation drawn that the arm cannot do.

    Raises
    ------
    UserError
        If the arm can do none of some variations drawn; tells what is wrong with the last.
    """
    for _ in range(_MOST_DRAWS):
        plan = plan_sketch(robot, variation(sketch, rng, timing_s, tempo, scene), scene)
        if not plan.violations:
            break
        refused(plan)
    plan.require_possible()
    return plan


def _moments(stroke: JointStroke) -> dict[str, float]:
    return {
        Moment.WIND_UP: stroke.start_time_s,
        Moment.CONTACT: stroke.hit_time_s,
        Moment.FOLLOW_THROUGH: stroke.end_time_s,
    }


def _face(sketch: Sketch, path: Array) -> float:
    """Which face looks at the coming ball."""
    coming = path_at(path, PATH_PERIOD_S, sketch.contact_s)[3:6]
    return 1.0 if sketch.contact.rotation[:, 1] @ coming < 0.0 else -1.0


def _postures(robot: Robot, sketch: Sketch) -> tuple[dict[Moment, Array], list[Violation]]:
    """Joint angles (N,) at each ghost, all of one family where possible; and what is out of reach."""
    starts = _starts(robot, sketch)
    postures: dict[Moment, Array] = {}
    unreached: list[Violation] = []
    for moment in (Moment.CONTACT, Moment.WIND_UP, Moment.FOLLOW_THROUGH):
        ghost = sketch.ghosts[moment]
        postures[moment], found = reach(robot, ghost.position, ghost.rotation, starts)
        unreached += [replace(each, ghost=moment) for each in found]
        starts = [postures[Moment.CONTACT], *starts]
    return postures, unreached


def _starts(robot: Robot, sketch: Sketch) -> list[Array]:
    """Joint angles to search a ghost from, the favourite first."""
    planning, starts = robot.planning, [robot.planning.middle_rad, robot.home_rad]
    rng = np.random.default_rng(0)
    starts += [rng.uniform(planning.hit_lower_rad, planning.hit_upper_rad) for _ in range(_OTHER_STARTS)]
    ready = ready_of(robot, sketch)
    return starts if ready is None else [ready, *starts]


def ready_of(robot: Robot, sketch: Sketch) -> Array | None:
    """The sketch's ready posture (N,), rad, or None.

    Raises
    ------
    UserError
        If it is none of this arm.
    """
    if sketch.ready_rad is None:
        return None
    ready, limits = np.array(sketch.ready_rad, dtype=np.float64), robot.limits
    if ready.shape != (robot.joint_count,) or not np.isfinite(ready).all():
        raise UserError(
            f"sketch {sketch.strategy}: ready_rad has {len(ready)} numbers; give a finite one for each of "
            f"{', '.join(robot.joint_names)}"
        )
    for name, angle, low, high in zip(
        robot.joint_names, ready, limits.lowest_rad, limits.highest_rad, strict=True
    ):
        if not low <= angle <= high:
            raise UserError(
                f"sketch {sketch.strategy}: ready_rad of {name} is {angle:.3f}; give {low:.3f} to {high:.3f}"
            )
    return ready


def _stroke(robot: Robot, sketch: Sketch, postures: dict[Moment, Array]) -> JointStroke:
    start, contact, end = (postures[moment] for moment in Moment)
    swing_s = sketch.swing_s or min(_half_way_s(robot, contact - start), sketch.contact_s)
    follow_s = sketch.follow_s or _half_way_s(robot, end - contact)
    stroke = stroke_from_rest(
        start,
        sketch.contact_s,
        contact,
        minimum_jerk_velocity(start, contact, end, swing_s, follow_s),
        swing_s=swing_s,
        follow_s=follow_s,
    )
    ready = ready_of(robot, sketch)
    lead_in = None if ready is None else lead_to(robot, ready, start, stroke.start_time_s)
    return replace(stroke, end_position=end, lead_in=lead_in)


def lead_to(robot: Robot, ready: Array, wind_up: Array, wind_up_time_s: float) -> JointStroke | None:
    """The way from the ready posture to rest in the wind-up (N,) at a time, if there is any way to go.

    As long as is comfortable; not before the launch.
    """
    if np.abs(wind_up - ready).max() < _NEAR_RAD:
        return None
    still = np.zeros_like(ready)
    duration_s = max(min(_way_s(robot, wind_up - ready), wind_up_time_s), PLAN_PERIOD_S)
    return stroke_from_rest(ready, wind_up_time_s, wind_up, still, swing_s=duration_s, follow_s=PLAN_PERIOD_S)


def _way_s(robot: Robot, way: Array) -> float:
    """A comfortable duration from rest to rest over a way (N,) in rad."""
    limits = robot.limits
    by_speed = _PEAK_SPEED * np.abs(way) / (_COMFORTABLE_SPEED * limits.speed_rad_s)
    most = _COMFORTABLE_ACCELERATION * limits.acceleration_rad_s2
    by_acceleration = np.sqrt(_PEAK_ACCELERATION * np.abs(way) / most)
    return float(np.clip(max(by_speed.max(), by_acceleration.max()), _SHORTEST_S, LONGEST_S))


def _half_way_s(robot: Robot, way: Array) -> float:
    """The same for half of such a way, from rest to where it is fastest or from there to rest."""
    return float(np.clip(0.5 * _way_s(robot, 2.0 * way), _SHORTEST_S, LONGEST_S))


@njit(cache=True, nogil=True)
def _paddles(arm: Arm, position: Array, velocity: Array) -> Array:
    paddles = np.empty((len(position), PADDLE_SIZE))
    for row in range(len(position)):
        place_moving_paddle(arm, position[row], velocity[row], paddles[row])
    return paddles
