"""Reading a robot from its folder: ``robot.yaml`` beside ``robot.urdf``.

Everything is checked before anything moves; a refusal names the file, the key and what to write.
"""

from __future__ import annotations

import hashlib
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.core.paddle import BLADE_RADIUS_M
from msrd_ros.core.resources import share_directory
from msrd_ros.robots.arm_model import pack
from msrd_ros.robots.chain import Chain, Frame, find_chain, frame, link_places
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.robot import DriverModel, FloatingModel, JointLimits, PlanningSpace, Robot
from msrd_ros.robots.sheet import Sheet, constant
from msrd_ros.robots.urdf import PADDLE_LINK, Description, JointOrigin, StandingArm, read_urdf

Array = NDArray[np.float64]

SHEET_FILE = "robot.yaml"
DESCRIPTION_FILE = "robot.urdf"
_PADDLE_FILE = Path(__file__).with_name("paddle.urdf")
_PADDLE_SPHERE_M = BLADE_RADIUS_M + 0.004
_HEIGHT_OF_PLAY_M = 0.96
"""Where balls are met: above the table's end on the robot's half."""
_FAR_BELOW_M = -100.0
"""Where the only sphere of an arm without a `stand` is: in nobody's way."""
_NEIGHBOURS_M = 0.06
"""Spheres that are nearer to each other than this in the home posture belong together."""
_PLACE_OF_PLAY_M = (-1.37, 0.0, _HEIGHT_OF_PLAY_M)


def robots_directory() -> Path:
    """Folder of the arms that come with the package."""
    return share_directory() / "config" / "robots"


def shipped_robots() -> tuple[str, ...]:
    """Names of the arms that come with the package."""
    return tuple(sorted(path.parent.name for path in robots_directory().glob(f"*/{SHEET_FILE}")))


def default_robot() -> Robot:
    """The arm that is meant where nothing is said."""
    return load_robot(DEFAULT_ROBOT)


def load_robot(robot: str | Path) -> Robot:
    """Load an arm.

    Parameters
    ----------
    robot
        Name of one that comes with the package, or a folder with ``robot.yaml`` and ``robot.urdf``.

    Raises
    ------
    UserError
        If there is none, or its description is broken; names the file, the key and what to write.
    """
    text = str(robot)
    folder = robots_directory() / text
    if "/" in text or text in ("", ".", "..") or not (folder / SHEET_FILE).is_file():
        folder = Path(text)
        if not text or not (folder / SHEET_FILE).is_file():
            raise UserError(
                f"robot {text!r}: is none of {', '.join(shipped_robots())} and no folder with {SHEET_FILE}; "
                "say one of these, or the folder of your own (docs/own_robot.md)"
            )
    return _load(folder.resolve(), _changed_ns(folder / SHEET_FILE), _changed_ns(folder / DESCRIPTION_FILE))


def _changed_ns(path: Path) -> int:
    """When a file was changed; 0 if it is not there, which is said when it is read."""
    return path.stat().st_mtime_ns if path.is_file() else 0


@cache
def _load(folder: Path, sheet_changed_ns: int, description_changed_ns: int) -> Robot:
    """Load an arm once for each state of its files."""
    sheet = Sheet.read(folder / SHEET_FILE)
    names = tuple(str(name) for name in sheet.items("joints", "the joints from the base to the hand"))
    if not names or len(set(names)) != len(names):
        raise UserError(f"{sheet.path}: joints is {list(names)}; list each joint once, base first")
    arm = read_urdf(folder / DESCRIPTION_FILE)
    base = sheet.pose("base")
    mount = JointOrigin("paddle_mount", sheet.text("paddle.link"), PADDLE_LINK, *sheet.pose("paddle"))
    paddle = read_urdf(_PADDLE_FILE)
    limits = _limits(sheet, arm, names)
    chain = find_chain(arm, names, mount, paddle.links[PADDLE_LINK])
    friction = sheet.joints("driver.friction_nm_s", names, low=0.0)
    home_rad = _posture(sheet, "home_rad", names, limits)
    model = _model(sheet, chain, limits, base, friction, home_rad)
    bounds = {
        name: {
            "lower": limits.lower_rad[i],
            "upper": limits.upper_rad[i],
            "velocity": limits.speed_rad_s[i],
            "effort": limits.torque_nm[i],
        }
        for i, name in enumerate(names)
    }
    shoulder = frame(*base).then(chain.joints[0])
    robot = Robot(
        name=sheet.text("name"),
        folder=folder,
        joint_names=names,
        link_names=tuple(arm.joints[name].child for name in names),
        limits=limits,
        driver=DriverModel(
            sheet.number("driver.stiffness_1_s2", low=0.0),
            sheet.number("driver.damping_1_s", low=0.0),
            sheet.number("driver.catch_up_1_s", low=0.0),
        ),
        floating=_floating(sheet, names),
        planning=_planning(sheet, names, limits),
        home_rad=home_rad,
        lift=_lift(sheet, names),
        model=model,
        shoulder=constant(shoulder.position),
        reach_m=_reach_m(chain),
        standing=StandingArm(arm, paddle, base, mount, bounds),
        digest=_digest(names, limits),
    )
    _require_reach(sheet, robot)
    sheet.require_known()
    return robot


def _limits(sheet: Sheet, arm: Description, names: tuple[str, ...]) -> JointLimits:
    lower = sheet.joints("limits.position_lower_rad", names)
    upper = sheet.joints("limits.position_upper_rad", names)
    margin = sheet.number("limits.position_margin_rad", low=0.0)
    for name, low, high in zip(names, lower, upper, strict=True):
        if not low + 2 * margin < high:
            raise UserError(
                f"{sheet.path}: limits of joint {name}: position_lower_rad {low} and position_upper_rad "
                f"{high} leave nothing between them; write the lower one first"
            )
    positive = {}
    for key in ("speed_rad_s", "acceleration_rad_s2", "torque_nm"):
        positive[key] = sheet.joints(f"limits.{key}", names, low=0.0)
        for name, value in zip(names, positive[key], strict=True):
            if value == 0.0:
                raise UserError(f"{sheet.path}: limits.{key} of joint {name} is 0; write what it can do")
    _require_within_urdf(sheet, arm, names, lower, upper, positive["speed_rad_s"], positive["torque_nm"])
    return JointLimits(lower, upper, constant(lower + margin), constant(upper - margin), **positive)


def _require_within_urdf(
    sheet: Sheet,
    arm: Description,
    names: tuple[str, ...],
    lower: Array,
    upper: Array,
    speed: Array,
    torque: Array,
) -> None:
    """Limits of robot.yaml may be narrower than the URDF's, never wider."""
    for index, name in enumerate(names):
        element = arm.root.find(f"joint[@name='{name}']/limit")
        if element is None:
            continue
        for key, value, sign, ours in (
            ("lower", lower[index], -1.0, "position_lower_rad"),
            ("upper", upper[index], 1.0, "position_upper_rad"),
            ("velocity", speed[index], 1.0, "speed_rad_s"),
            ("effort", torque[index], 1.0, "torque_nm"),
        ):
            text = element.get(key)
            try:
                published = math.inf * sign if text is None else float(text)
            except ValueError:
                published = math.nan
            if math.isnan(published):
                raise UserError(f"{arm.path}: joint {name}: limit {key} is {text!r}; write a number")
            if sign * value > sign * published + 1e-9:
                raise UserError(
                    f"{sheet.path}: limits.{ours} of joint {name} is {value}, wider than {key} "
                    f"{published} in {arm.path.name}; write a narrower one"
                )


def _model(
    sheet: Sheet,
    chain: Chain,
    limits: JointLimits,
    base: tuple[tuple[float, float, float], tuple[float, float, float]],
    friction: Array,
    home_rad: Array,
) -> NDArray[np.void]:
    links, centres, radii = [], [], []
    for index, item in enumerate(sheet.items("keep_out", "spheres {link, centre_m, radius_m}")):
        place, centre, radius = _sphere(sheet, f"keep_out[{index}]", item, chain)
        links.append(place[0])
        centres.append(centre)
        radii.append(radius)
    links.append(len(chain.joints) - 1)
    centres.append(chain.paddle.position)
    radii.append(_PADDLE_SPHERE_M)
    stand = frame(*base)
    return pack(
        {
            "base_position": stand.position,
            "base_rotation": stand.rotation + 0.0,
            "offsets": np.array([joint.position for joint in chain.joints]),
            "rotations": np.array([joint.rotation for joint in chain.joints]),
            "paddle_position": chain.paddle.position,
            "paddle_rotation": chain.paddle.rotation + 0.0,
            "masses": np.array([body.mass for body in chain.bodies]),
            "centres": np.array([body.centre for body in chain.bodies]),
            "inertias": np.array([body.inertia for body in chain.bodies]),
            "friction": friction,
            "lower": limits.lower_rad,
            "upper": limits.upper_rad,
            "lowest": limits.lowest_rad,
            "highest": limits.highest_rad,
            "speed": limits.speed_rad_s,
            "acceleration": limits.acceleration_rad_s2,
            "torque": limits.torque_nm,
            "sphere_links": np.array(links, dtype=np.int64),
            "sphere_centres": np.array(centres),
            "sphere_radii": np.array(radii),
            "stand": _stand(sheet, base),
            "apart": _apart(chain, stand, home_rad, links, centres, radii),
        }
    )


def _sphere(sheet: Sheet, key: str, item: Any, chain: Chain) -> tuple[tuple[int, Any], Array, float]:
    """Which joint carries a sphere, its centre in the chain's frame behind it, and its radius in m."""
    inner = Sheet(sheet.path, item if isinstance(item, dict) else {}, key)
    link = inner.text("link")
    if link not in chain.places:
        raise UserError(
            f"{sheet.path}: {key}: no link {link!r} in {DESCRIPTION_FILE}; use one of "
            f"{', '.join(chain.places)}"
        )
    index, place = chain.places[link]
    centre = np.array(inner.vector("centre_m"))
    if place.position.any() or not np.array_equal(place.rotation, np.eye(3)):
        centre = place.position + place.rotation @ centre
    radius = inner.number("radius_m", low=0.0)
    inner.require_known()
    return (index, place), centre, radius


def _apart(
    chain: Chain, stand: Frame, home_rad: Array, links: list[int], centres: list[Array], radii: list[float]
) -> NDArray[np.int64]:
    """Pairs of spheres that must not meet, shape (P, 2): those of other links, not neighbours at home."""
    frames = link_places(chain, stand, home_rad)
    places = [
        frames[link].position + frames[link].rotation @ c for link, c in zip(links, centres, strict=True)
    ]
    pairs = [
        (one, other)
        for one in range(len(links))
        for other in range(one)
        if links[one] - links[other] >= 2
        and np.linalg.norm(places[one] - places[other]) - radii[one] - radii[other] > _NEIGHBOURS_M
    ]
    return np.array(pairs or [(0, 0)], dtype=np.int64)


def _stand(sheet: Sheet, base: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Array:
    if not sheet.has("stand"):
        return constant([[0.0, 0.0, _FAR_BELOW_M, 0.0]])
    place = frame(*base)
    rows = []
    for index, item in enumerate(sheet.items("stand", "spheres {centre_m, radius_m}")):
        inner = Sheet(sheet.path, item if isinstance(item, dict) else {}, f"stand[{index}]")
        centre = place.position + place.rotation @ np.array(inner.vector("centre_m"))
        rows.append([*centre, inner.number("radius_m", low=0.0)])
        inner.require_known()
    return constant(rows)


def _posture(sheet: Sheet, key: str, names: tuple[str, ...], limits: JointLimits) -> Array:
    posture = sheet.joints(key, names)
    for name, angle, low, high in zip(names, posture, limits.lowest_rad, limits.highest_rad, strict=True):
        if not low <= angle <= high:
            raise UserError(
                f"{sheet.path}: {key} of joint {name} is {angle}; write an angle from {low} to {high}, "
                "within its limits and their margin"
            )
    return posture


def _lift(sheet: Sheet, names: tuple[str, ...]) -> tuple[int, float]:
    joint = sheet.text("lift.joint")
    if joint not in names:
        raise UserError(f"{sheet.path}: lift.joint is {joint}; write one of {', '.join(names)}")
    return names.index(joint), math.copysign(1.0, sheet.number("lift.direction", low=-1.0, high=1.0))


def _floating(sheet: Sheet, names: tuple[str, ...]) -> FloatingModel:
    brake_full = sheet.number("teaching.brake_full", low=0.0, high=1.0)
    brake_from = sheet.number("teaching.brake_from", low=0.0, high=1.0)
    if not brake_from < brake_full:
        raise UserError(
            f"{sheet.path}: teaching.brake_from is {brake_from}; write less than brake_full, {brake_full}"
        )
    return FloatingModel(sheet.joints("teaching.joint_damping_nm_s", names, low=0.0), brake_from, brake_full)


def _planning(sheet: Sheet, names: tuple[str, ...], limits: JointLimits) -> PlanningSpace:
    bounds = {}
    for key in ("hit_lower_rad", "hit_upper_rad", "rest_lower_rad", "rest_upper_rad", "middle_rad"):
        bounds[key] = _posture(sheet, f"planning.{key}", names, limits)
    for part in ("hit", "rest"):
        lower, upper = bounds[f"{part}_lower_rad"], bounds[f"{part}_upper_rad"]
        for name, low, high in zip(names, lower, upper, strict=True):
            if not low < high:
                raise UserError(
                    f"{sheet.path}: planning of joint {name}: {part}_lower_rad {low} and {part}_upper_rad "
                    f"{high} leave nothing between them; write the lower one first"
                )
    return PlanningSpace(**bounds)


def _reach_m(chain: Chain) -> float:
    """From the first joint to the blade's far rim, were all links in line: no arm reaches farther."""
    links = [*(joint.position for joint in chain.joints[1:]), chain.paddle.position]
    return sum(float(np.linalg.norm(offset)) for offset in links) + BLADE_RADIUS_M


def _require_reach(sheet: Sheet, robot: Robot) -> None:
    """Refuse an arm that cannot meet a ball over the end of the table, however it is bent."""
    distance_m = float(np.linalg.norm(robot.shoulder - np.array(_PLACE_OF_PLAY_M)))
    if distance_m > robot.reach_m:
        raise UserError(
            f"{sheet.path}: base.position_m: the end of the table, where balls are met, is "
            f"{distance_m:.2f} m from the first joint, and arm and paddle reach {robot.reach_m:.2f} m; "
            "put the base nearer to "
            "the table's end at x = -1.37"
        )


def _digest(names: tuple[str, ...], limits: JointLimits) -> str:
    parts = [names, limits.lower_rad.tolist(), limits.upper_rad.tolist(), limits.speed_rad_s.tolist()]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]
