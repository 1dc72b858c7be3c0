"""Plans the six strokes of our own: a ready pose for each side, and from it a push, a slice and a topspin.

Each side is one least-squares problem, `stroke_side`, solved from good postures that a seeded search around
the arm's home finds; the best plan is taken whose ready pose the arm gets to and from without touching the
table. Planning takes seconds; its result is kept beside this file and written by

    python -m msrd_ros.table_tennis.teachers.planner --write
"""

from __future__ import annotations

import argparse
import json
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.core.errors import UserError
from msrd_ros.robots.kinematics import link_frames, paddle_pose
from msrd_ros.robots.limits import JointReference, shape_command, velocity_towards
from msrd_ros.robots.quintic import JointStroke, stroke_from_rest
from msrd_ros.robots.sawyer import HOME_POSTURE_RAD, SPEED_LIMIT_RAD_S
from msrd_ros.robots.sawyer_description import BLADE_RADIUS_M
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.hit_solver import POSITION, RATE, TIME, solve_hit
from msrd_ros.table_tennis.teachers.side import (
    CLEAR_OF_TABLE_M,
    PATH_PERIOD_S,
    PlannerConfig,
    SideProblem,
    feed_path,
    wish_for,
)

Array = NDArray[np.float64]

PLAN_FILE = Path(__file__).with_name("planned_strokes.json")

_SEARCH_SD_RAD = 0.8
_WRIST_SEARCH_RAD = (-3.2, 3.2)
_ANOTHER_FAMILY_RAD = 0.3
_NEAR_TABLE_X_M = -1.5
_LONGEST_WAY_STEPS = 500


def plan_side(
    side: Side, config: PlannerConfig, scene: Scene, feeder: Feeder, resting: list[Array]
) -> dict[PaperLabel, JointStroke]:
    """Plan the three strokes of one side against its nominal feed, from random postures. Takes seconds.

    Parameters
    ----------
    side, config, scene, feeder
        What to plan for.
    resting
        Postures (7,) that the arm comes from and goes to between strokes, clear of the table.

    Raises
    ------
    UserError
        If no plan keeps clear of the table; more `searches` may find one.
    """
    constants = scene.constants()
    problem = SideProblem(side, config, feed_path(feeder.nominal(side), constants), constants)
    best = _solve_clear(problem, resting)
    return {
        label: stroke_from_rest(
            best[:7],
            float(problem.hit(best, index)[TIME]),
            problem.hit(best, index)[POSITION].copy(),
            problem.hit(best, index)[RATE] * SPEED_LIMIT_RAD_S,
            swing_s=config.swing_s,
            follow_s=config.follow_s,
        )
        for index, label in enumerate(problem.labels)
    }


def _solve_clear(problem: SideProblem, resting: list[Array]) -> Array:
    """The best plan of one side found whose ways to and from the resting postures are clear."""
    config = problem.config
    rng = np.random.default_rng(config.seed)
    guesses = []
    for _ in range(config.searches):
        posture = HOME_POSTURE_RAD + _SEARCH_SD_RAD * rng.standard_normal(7)
        posture[6] = rng.uniform(*_WRIST_SEARCH_RAD)
        wish = wish_for(problem.labels[0], config, posture, 0.1)
        start = np.concatenate([[config.hit_time_s], posture, np.zeros(7)])
        push, cost = solve_hit(start, wish, problem.path, PATH_PERIOD_S, problem.scene, 80)
        guesses.append((cost, push))
    guesses.sort(key=lambda guess: guess[0])
    starts = sorted((problem.start(push) for _, push in guesses[: 10 * config.refined]), key=lambda s: s[1])
    families: list[Array] = []
    for start, _ in starts:
        another = all(np.abs(start[:7] - other[:7]).max() > _ANOTHER_FAMILY_RAD for other in families)
        if another and len(families) < config.refined and _ways_are_clear(start[:7], resting):
            families.append(start)
    plans = sorted((problem.solve(start) for start in families), key=lambda plan: plan[1])
    for plan, _ in plans:
        if _ways_are_clear(plan[:7], resting):
            return plan
    raise UserError("stroke planner: no plan found that keeps clear of the table; raise searches or refined")


def _ways_are_clear(ready: Array, resting: list[Array]) -> bool:
    """Whether a ready pose can be reached from, and left for, every resting posture."""
    ways = [(ready, other) for other in resting] + [(other, ready) for other in resting]
    return all(lowest_on_path(start, goal) > CLEAR_OF_TABLE_M for start, goal in ways)


def lowest_on_path(start: Array, goal: Array) -> float:
    """Least height in m of blade and forearm over the table, on the arm's own way between two postures.

    The way is the one that the executor takes between strokes; infinite where it is never over the table.
    """
    reference = JointReference(start.copy(), np.zeros(7))
    lowest = np.inf
    for _ in range(_LONGEST_WAY_STEPS):
        wanted = velocity_towards(reference, goal, CONTROL_PERIOD_S)
        reference = shape_command(reference, wanted, CONTROL_PERIOD_S)
        centre, rotation = paddle_pose(reference.position)
        origins, _ = link_frames(reference.position)
        edge = centre - BLADE_RADIUS_M * np.array([0.0, 0.0, np.sqrt(max(1.0 - rotation[2, 1] ** 2, 0.0))])
        points = np.vstack([edge, origins[3:]])
        near = points[:, 0] > _NEAR_TABLE_X_M
        lowest = min(lowest, points[near, 2].min(initial=np.inf))
        if np.abs(reference.position - goal).max() < 1e-3:
            break
    return float(lowest)


def plan_all(
    config: PlannerConfig | None = None, scene: Scene | None = None, feeder: Feeder | None = None
) -> dict[PaperLabel, JointStroke]:
    """Plan all six strokes."""
    strokes: dict[PaperLabel, JointStroke] = {}
    resting = [HOME_POSTURE_RAD]
    for side in Side:
        plan = plan_side(side, config or PlannerConfig(), scene or Scene(), feeder or Feeder(), resting)
        strokes |= plan
        resting.append(next(iter(plan.values())).start.position)
    return strokes


def write_strokes(strokes: dict[PaperLabel, JointStroke], path: Path = PLAN_FILE) -> None:
    """Keep planned strokes as JSON; times in s, angles in rad."""
    document = {
        str(label): {
            "ready_position": [round(float(value), 6) for value in stroke.start.position],
            "hit_time_s": round(stroke.hit_time_s, 6),
            "hit_position": [round(float(value), 6) for value in stroke.hit_position],
            "hit_velocity": [round(float(value), 6) for value in stroke.hit_velocity],
            "swing_s": round(stroke.hit_time_s - stroke.start_time_s, 6),
            "follow_s": round(stroke.follow_s, 6),
        }
        for label, stroke in strokes.items()
    }
    path.write_text(json.dumps(document, indent=1) + "\n")


@cache
def planned_strokes(path: Path = PLAN_FILE) -> dict[PaperLabel, JointStroke]:
    """The kept strokes for the standard scene and the nominal feed.

    Raises
    ------
    UserError
        If the file is missing, damaged or incomplete.
    """
    try:
        document = json.loads(path.read_text())
        return {
            label: stroke_from_rest(
                np.array(document[str(label)]["ready_position"]),
                float(document[str(label)]["hit_time_s"]),
                np.array(document[str(label)]["hit_position"]),
                np.array(document[str(label)]["hit_velocity"]),
                swing_s=float(document[str(label)]["swing_s"]),
                follow_s=float(document[str(label)]["follow_s"]),
            )
            for label in ALL_LABELS
        }
    except (OSError, ValueError, KeyError) as error:
        raise UserError(
            f"{path}: no usable planned strokes ({error!r}); "
            "write them with python -m msrd_ros.table_tennis.teachers.planner --write"
        ) from None


def main(arguments: list[str] | None = None) -> None:
    """Plan all strokes, show them, and keep them if asked to."""
    parser = argparse.ArgumentParser(description="Plan the six strokes for the standard scene.")
    parser.add_argument("--write", action="store_true", help=f"keep them in {PLAN_FILE.name}")
    options = parser.parse_args(arguments)
    strokes = plan_all()
    for label, stroke in strokes.items():
        speed, acceleration = stroke.peak_fractions()
        print(
            f"{label}: hit at {stroke.hit_time_s:.3f} s, at most {speed.max():.0%} of the speed limits and "
            f"{acceleration.max():.0%} of the acceleration limits"
        )
    if options.write:
        write_strokes(strokes)
        print(f"written to {PLAN_FILE.name}")


if __name__ == "__main__":
    main()
