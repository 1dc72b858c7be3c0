"""Strokes of one arm as strokes of another, by inverse kinematics of the paddle's path.

What moves the ball is the blade: where its centre is, which way its face looks, and how both change. So the
other arm is to bring the blade there at each tick; how the handle stands about the normal is left to it. What
its limits do not let it follow stays behind, by the very law that its commands keep to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.inverse_kinematics import reach_blade
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.limits import JointReference, shape_command
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.arm.collision_model import MARGIN_M
from msrd_ros.table_tennis.arm.via_point_path import room
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.strokes.batched_play import play_batch
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

Array = NDArray[np.float64]

_CATCH_UP_1_S = 10.0
"""How fast an arm that was left behind closes up to the path."""
_REACHED_M = 0.01
_RAD_AS_M = 0.2
"""What a radian of the face off its way counts as in metres of the blade: the ball lands off by as much."""
_ROOM_WEIGHT = 10.0


@dataclass(frozen=True)
class RetargetingConfig:
    """Settings.

    Attributes
    ----------
    strokes
        Of each strategy: returned strokes that are taken over.
    starts
        Postures from which a way to wait for the ball is looked for.
    spread
        Of the feeds, a key of `SPREADS`.
    seed
        Everything random follows from it.
    """

    strokes: int = 24
    starts: int = 64
    spread: str = "twice"
    seed: int = 0


class Followed(NamedTuple):
    """Joints that followed paths: (K, T, N) in rad and rad/s."""

    position: Array
    velocity: Array


@dataclass(frozen=True)
class Retargeted:
    """Strokes of the other arm.

    Attributes
    ----------
    episodes
        As if they had been shown on it, with the ball as it was on the first one.
    miss_m, miss_rad
        How far the blade was off its path, by strategy: centre and normal, mean over strokes and ticks.
    """

    episodes: list[Episode]
    miss_m: Mapping[StrategyLabel, float]
    miss_rad: Mapping[StrategyLabel, float]


def play_returned(policies: StrokePolicies, config: RetargetingConfig) -> dict[StrategyLabel, Array]:
    """Returned strokes of learned policies in the batched simulator: observations (K, T + 1, N + 6) by label.

    Raises
    ------
    UserError
        If a strategy returns nothing.
    """
    targets = np.stack(
        [np.repeat(facts.landing_point[None], 2 * config.strokes, 0) for facts in policies.facts.values()]
    )
    rng = np.random.default_rng((config.seed, 0x2E7A))
    results, played = play_batch(policies, targets, RallyVariation(SPREADS[config.spread]), rng)
    returned = results.returned
    found = {}
    for row, label in enumerate(policies.labels):
        if not returned[row].any():
            raise UserError(f"{label}: no ball of {2 * config.strokes} is returned; give policies that play")
        found[label] = played[row, returned[row]][: config.strokes].astype(np.float64)
    return found


def retarget(
    shown: Mapping[StrategyLabel, Array], taught: Robot, robot: Robot, config: RetargetingConfig
) -> Retargeted:
    """Strokes of `taught` as strokes of `robot`.

    Parameters
    ----------
    shown
        Observations (K, T + 1, N + 6) of the arm that was taught, by label, from the first acting step on.

    Raises
    ------
    UserError
        If the other arm cannot bring the blade to where a strategy waits.
    """
    episodes: list[Episode] = []
    miss_m, miss_rad = {}, {}
    for row, (label, seen) in enumerate(shown.items()):
        joints = taught.joint_count
        blades = [_blades(taught, stroke[: ACTING_STEPS + 1, :joints]) for stroke in seen]
        rng = np.random.default_rng((config.seed, row))
        ready = _best_start(robot, blades[0], label, config.starts, rng)
        followed = follow(robot, blades, ready, seen.shape[1])
        off = np.array([_misses(robot, q, b) for q, b in zip(followed.position, blades, strict=True)])
        miss_m[label], miss_rad[label] = (float(value) for value in off.mean((0, 1)))
        for stroke, position, velocity in zip(seen, followed.position, followed.velocity, strict=True):
            # Strokes begin a step before anybody acts; of that row nothing but the posture is looked at.
            joint, rate, seen_ball, motion = (
                np.concatenate([column[:1], column])
                for column in (position, velocity, stroke[:, joints : joints + 3], stroke[:, joints + 3 :])
            )
            source = f"{label} of {taught.name}"
            episodes.append(Episode(label, joint, rate, seen_ball, motion, taught.name, source, robot=robot))
    return Retargeted(episodes, miss_m, miss_rad)


def follow(robot: Robot, blades: Sequence[tuple[Array, Array]], ready: Array, rows: int) -> Followed:
    """Joints that bring the blade along paths as far as the limits let them.

    Parameters
    ----------
    blades
        Centres (T_act + 1, 3) in m and normals (T_act + 1, 3) of each path.
    ready
        Posture near which the arm waits, (N,), rad.
    rows
        How many there are to be: behind T_act + 1 the arm brakes and rests.
    """
    wanted = np.stack([_solve(robot, places, normals, ready) for places, normals in blades])
    reference = JointReference(wanted[:, 0].copy(), np.zeros_like(wanted[:, 0]))
    positions, velocities = [reference.position], [reference.velocity]
    last = wanted.shape[1] - 1
    for step in range(rows - 1):
        velocity = np.zeros_like(reference.position)
        if step < last:
            ahead = wanted[:, min(step + 2, last)] - wanted[:, step]
            velocity = ahead / (CONTROL_PERIOD_S * (min(step + 2, last) - step))
            velocity = velocity + _CATCH_UP_1_S * (wanted[:, step] - reference.position)
        reference = shape_command(robot, reference, velocity, CONTROL_PERIOD_S)
        positions.append(reference.position)
        velocities.append(reference.velocity)
    return Followed(np.stack(positions, axis=1), np.stack(velocities, axis=1))


def _solve(robot: Robot, places: Array, normals: Array, start: Array) -> Array:
    """Angles (T, N) that put the blade on its path, each found from the one before."""
    limits, found = robot.limits, [start]
    for place, normal in zip(places, normals, strict=True):
        found.append(
            reach_blade(
                robot, place, normal, found[-1], lower=limits.lowest_rad, upper=limits.highest_rad,
                posture_pull=0.0, steps=30,
            ).joint_position
        )  # fmt: skip
    return np.array(found[1:])


def _best_start(
    robot: Robot, blades: tuple[Array, Array], label: StrategyLabel, starts: int, rng: np.random.Generator
) -> Array:
    """The posture to wait in from which the arm follows a path best, and clear of everything."""
    planning = robot.planning
    tried = [planning.middle_rad, robot.home_rad]
    tried += list(rng.uniform(planning.rest_lower_rad, planning.rest_upper_rad, (starts, robot.joint_count)))
    best, least = None, np.inf
    for start in tried:
        reached = reach_blade(
            robot, blades[0][0], blades[1][0], start, planning.middle_rad,
            lower=robot.limits.lowest_rad, upper=robot.limits.highest_rad,
        )  # fmt: skip
        if reached.distance_m + _RAD_AS_M * reached.angle_rad > _REACHED_M:
            continue
        followed = follow(robot, [blades], reached.joint_position, len(blades[0])).position[0]
        off = _misses(robot, followed, blades)
        tight = max(0.0, MARGIN_M - min(room(robot, posture) for posture in followed))
        cost = float((off[:, 0] + _RAD_AS_M * off[:, 1]).mean() + _ROOM_WEIGHT * tight)
        if cost < least:
            best, least = reached.joint_position, cost
    if best is None:
        raise UserError(
            f"{robot.name}: cannot bring its blade to where {label} waits for the ball; move its base, or "
            "begin from nothing with ready poses of its own"
        )
    return best


def _blades(robot: Robot, joints: Array) -> tuple[Array, Array]:
    """Centres and normals of the blade, (T, 3) each, at angles (T, N)."""
    poses = [paddle_pose(robot.model, posture) for posture in np.ascontiguousarray(joints, dtype=np.float64)]
    return np.array([place for place, _ in poses]), np.array([rotation[:, 1] for _, rotation in poses])


def _misses(robot: Robot, joints: Array, blades: tuple[Array, Array]) -> Array:
    """How far the blade is off its path, (T, 2): m and rad."""
    places, normals = _blades(robot, joints[: len(blades[0])])
    cosine = np.clip((normals * blades[1]).sum(axis=1), -1.0, 1.0)
    return np.stack([np.linalg.norm(places - blades[0], axis=1), np.arccos(cosine)], axis=1)
