"""Plans the six strokes of our own: a ready pose for each side, and from it a push, a slice and a topspin.

Each side is one least-squares problem, `side`, solved from good postures that a seeded search within the
robot's planning space finds; the best plan is taken whose ready pose the arm gets to and from without
touching table, floor or itself, and which returns the nominal ball when it is played. Planning takes a minute
or two; its result is kept beside the robot's description, for the table and the nominal feeds as they are.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_text
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.quintic import JointStroke, stroke_from_rest
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.via_point_path import find_path, follow_path, room
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.hit_solver import TIME, angles_of, rates_of, solve_hit
from msrd_ros.table_tennis.teachers.open_loop import play_open_loop
from msrd_ros.table_tennis.teachers.side import (
    PATH_PERIOD_S,
    PlannerConfig,
    SideProblem,
    feed_path,
    wish_for,
)

Array = NDArray[np.float64]

PLAN_FILE = "strokes.yaml"
"""Beside ``robot.yaml``."""
PLAN_FORMAT = 1

_ANOTHER_FAMILY_RAD = 0.3
_LONGEST_PATH_STEPS = 500
LEAST_ROOM_ON_PATH_M = 0.03
"""About the arm, on its way to a ready pose and back."""

MOST_COST = 10.0
"""Of a side's plan; those of the arms that ship cost 0.9 to 5.3. Above it some condition is missed by far."""


def plan_side(
    robot: Robot,
    side: Side,
    config: PlannerConfig,
    scene: Scene,
    feeder: Feeder,
    resting: list[Array],
    kept: Mapping[PaperLabel, JointStroke] | None = None,
) -> dict[PaperLabel, JointStroke]:
    """Plan the three strokes of one side against its nominal feed, from random postures and from kept ones.

    Parameters
    ----------
    robot, side, config, scene, feeder
        What to plan for.
    resting
        Postures (N,) that the arm comes from and goes to between strokes, clear of the table.
    kept
        Strokes of this arm from before: their postures are tried as well, so that a new plan is never worse.

    Raises
    ------
    UserError
        If no plan keeps clear of table, floor and arm, is within what the arm can do, and returns the ball.
    """
    constants = scene.constants()
    problem = SideProblem(robot, side, config, feed_path(feeder.nominal(side), constants), constants)
    faults = []
    for plan, cost in sorted(_solve_families(problem, resting, kept), key=lambda found: found[1]):
        strokes = _strokes_of(problem, plan)
        fault = find_fault(robot, strokes, cost, resting, scene, feeder)
        if not fault:
            return strokes
        faults.append(fault)
    faults.append("no posture found that is reached clear of table and arm")
    raise UserError(
        f"{robot.folder}: no {side} strokes: {faults[0]}; move `base` in robot.yaml, widen what `planning` "
        "allows, or give the limits that the arm really has"
    )


def _strokes_of(problem: SideProblem, plan: Array) -> dict[PaperLabel, JointStroke]:
    robot, config = problem.robot, problem.config
    return {
        label: stroke_from_rest(
            plan[: robot.joint_count],
            float(problem.hit(plan, index)[TIME]),
            angles_of(problem.hit(plan, index)).copy(),
            rates_of(problem.hit(plan, index)) * robot.limits.speed_rad_s,
            swing_s=config.swing_s,
            follow_s=config.follow_s,
        )
        for index, label in enumerate(problem.labels)
    }


def find_fault(
    robot: Robot,
    strokes: dict[PaperLabel, JointStroke],
    cost: float,
    resting: list[Array],
    scene: Scene,
    feeder: Feeder,
) -> str:
    """What is wrong with a side's planned strokes; empty if nothing is.

    Parameters
    ----------
    cost
        Of the plan that they come from.
    resting
        Postures (N,) that the arm comes from and goes to between strokes.
    """
    if cost > MOST_COST:
        return (
            f"the best plan asks for more than the arm can do (cost {cost:.1f}, at most {MOST_COST:g}, of "
            "speed, acceleration, room and where the ball lands)"
        )
    if not _paths_are_clear(robot, next(iter(strokes.values())).start.position, resting):
        return "the ready pose is not reached clear of table and arm"
    returned = play_open_loop(robot, strokes, np.random.default_rng(0), scene=scene, feeder=feeder).returned
    missed = [str(label) for label, balls in zip(strokes, returned, strict=True) if not balls.all()]
    return f"planned {', '.join(missed)} played as planned does not return the nominal ball" if missed else ""


def _solve_families(
    problem: SideProblem, resting: list[Array], kept: Mapping[PaperLabel, JointStroke] | None
) -> list[tuple[Array, float]]:
    """Plans of one side from different families of postures, each with its cost."""
    config, robot = problem.config, problem.robot
    count = robot.joint_count
    rng = np.random.default_rng(config.seed)
    guesses = []
    for _ in range(config.searches):
        posture = rng.uniform(robot.planning.hit_lower_rad, robot.planning.hit_upper_rad)
        wish = wish_for(robot, problem.labels[0], config, posture, 0.1)
        start = np.concatenate([[config.hit_time_s], posture, np.zeros(count)])
        push, cost = solve_hit(robot.model, start, wish, problem.path, PATH_PERIOD_S, problem.scene, 80)
        guesses.append((cost, push))
    guesses.sort(key=lambda guess: guess[0])
    starts = sorted((problem.start(push) for _, push in guesses[: 10 * config.refined]), key=lambda s: s[1])
    families: list[Array] = []
    for start, _ in starts:
        ready = start[:count]
        another = all(np.abs(ready - other[:count]).max() > _ANOTHER_FAMILY_RAD for other in families)
        if another and len(families) < config.refined and _paths_are_clear(robot, ready, resting):
            families.append(start)
    if kept is not None:
        families.append(_plan_of(problem, kept))
    return [problem.solve(start) for start in families]


def _plan_of(problem: SideProblem, strokes: Mapping[PaperLabel, JointStroke]) -> Array:
    """A plan that strokes follow from; `_strokes_of` undone."""
    own = [strokes[label] for label in problem.labels]
    speeds = problem.robot.limits.speed_rad_s
    hits = [np.r_[stroke.hit_time_s, stroke.hit_position, stroke.hit_velocity / speeds] for stroke in own]
    return np.concatenate([own[0].start.position, *hits])


def _paths_are_clear(robot: Robot, ready: Array, resting: list[Array]) -> bool:
    """Whether a ready pose can be reached from, and left for, every resting posture."""
    paths = [(ready, other) for other in resting] + [(other, ready) for other in resting]
    return all(room_on_path(robot, start, goal) > LEAST_ROOM_ON_PATH_M for start, goal in paths)


def room_on_path(robot: Robot, start: Array, goal: Array) -> float:
    """Least distance in m of the arm from table, floor, stand and itself, on the way from rest to rest.

    The path is the one that the executor takes between strokes.
    """
    reference = JointReference(start.copy(), np.zeros_like(start))
    path = find_path(robot, reference, goal)
    least_m = np.inf
    left: Any = path
    for _ in range(_LONGEST_PATH_STEPS):
        reference, left = follow_path(robot, reference, left, goal, CONTROL_PERIOD_S)
        least_m = min(least_m, room(robot, reference.position))
        if not left and np.abs(reference.position - goal).max() < 1e-3:
            break
    return float(least_m)


def plan_all(
    robot: Robot,
    config: PlannerConfig | None = None,
    scene: Scene | None = None,
    feeder: Feeder | None = None,
    kept: Mapping[PaperLabel, JointStroke] | None = None,
) -> dict[PaperLabel, JointStroke]:
    """Plan all six strokes; see `plan_side`.

    Raises
    ------
    UserError
        If the arm cannot play them.
    """
    strokes: dict[PaperLabel, JointStroke] = {}
    resting = [robot.home_rad.copy()]
    for side in Side:
        plan = plan_side(
            robot, side, config or PlannerConfig(), scene or Scene(), feeder or Feeder(), resting, kept
        )
        strokes |= plan
        resting.append(next(iter(plan.values())).start.position)
    return strokes


def plan_key(robot: Robot) -> str:
    """Tells the arms and places apart that strokes are planned for, in few letters."""
    return hashlib.sha256(robot.model.tobytes()).hexdigest()[:12]


def write_strokes(robot: Robot, strokes: dict[PaperLabel, JointStroke], path: Path) -> None:
    """Keep planned strokes as YAML; times in s, angles in rad.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    document = {
        str(label): {
            "ready_position": _rounded(stroke.start.position),
            "hit_time_s": round(stroke.hit_time_s, 6),
            "hit_position": _rounded(stroke.hit_position),
            "hit_velocity": _rounded(stroke.hit_velocity),
            "swing_s": round(stroke.hit_time_s - stroke.start_time_s, 6),
            "follow_s": round(stroke.follow_s, 6),
        }
        for label, stroke in strokes.items()
    }
    head = (
        f"# Strokes planned for {robot.name} at the standard table; written by `python -m msrd_ros plan`.\n"
        "# Times in s since the ball's launch, angles in rad. `planned_for` tells the arm as it was then.\n"
    )
    body = yaml.safe_dump(
        {FORMAT_KEY: PLAN_FORMAT, "planned_for": plan_key(robot), **document},
        sort_keys=False,
        default_flow_style=None,
        width=110,
    )
    write_text(path, head + body)


def _rounded(values: Array) -> list[float]:
    return [round(float(value), 6) for value in values]


def planned_strokes(
    robot: Robot | None = None, tell: Callable[[str], None] = print
) -> dict[PaperLabel, JointStroke]:
    """The strokes kept for an arm, for the standard scene and the nominal feed; planned if there are none.

    Parameters
    ----------
    robot
        Which arm; the default one if None.
    tell
        Hears that strokes have to be planned first, which takes a while.

    Raises
    ------
    UserError
        If the file is damaged, incomplete or of another arm; or none can be planned.
    """
    arm = robot or default_robot()
    path = arm.folder / PLAN_FILE
    if not path.exists():
        tell(f"planning strokes for {arm.name}, once; a minute or two, kept in {path}")
        write_strokes(arm, plan_all(arm), path)
    return _read_strokes(path, path.stat().st_mtime_ns, plan_key(arm), arm.joint_count)


def kept_strokes(robot: Robot) -> dict[PaperLabel, JointStroke] | None:
    """The strokes kept for an arm, even from before it was changed; None if there are none of its joints."""
    path = robot.folder / PLAN_FILE
    try:
        return _read_strokes(path, path.stat().st_mtime_ns, None, robot.joint_count)
    except (OSError, UserError):
        return None


@cache
def _read_strokes(path: Path, changed_ns: int, key: str | None, joints: int) -> dict[PaperLabel, JointStroke]:
    remedy = f"write them with python -m msrd_ros plan {path.parent}"
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        require_format(document.get(FORMAT_KEY, FIRST_FORMAT), PLAN_FORMAT, str(path))
        planned_for = document["planned_for"]
        strokes = {label: _stroke(document[str(label)], joints) for label in ALL_LABELS}
    except (OSError, ValueError, AttributeError, KeyError, TypeError, yaml.YAMLError) as error:
        raise UserError(f"{path}: no usable planned strokes ({error!r}); {remedy}") from None
    if key is not None and planned_for != key:
        raise UserError(f"{path}: planned for the arm as it was ({planned_for}, now {key}); {remedy}")
    return strokes


def _stroke(values: dict[str, Any], joints: int) -> JointStroke:
    arrays = [
        np.array(values[key], dtype=np.float64) for key in ("ready_position", "hit_position", "hit_velocity")
    ]
    if any(array.shape != (joints,) for array in arrays):
        raise ValueError(f"not {joints} numbers for {joints} joints")
    ready, position, velocity = arrays
    return stroke_from_rest(
        ready,
        float(values["hit_time_s"]),
        position,
        velocity,
        swing_s=float(values["swing_s"]),
        follow_s=float(values["follow_s"]),
    )
