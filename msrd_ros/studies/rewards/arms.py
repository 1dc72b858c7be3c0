"""Arms that nobody has taught: others that ship, and slower ones than the one that was taught."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.robots.loading import DESCRIPTION_FILE, SHEET_FILE, load_robot
from msrd_ros.robots.robot import Robot

_VARIANT = re.compile(r"(?P<arm>.+)_(?P<share>\d+)_percent")


def arm(name: str, folder: Path) -> Robot:
    """A shipped arm by its name, or ``<name>_<n>_percent``: with n % of its speed limits.

    Parameters
    ----------
    folder
        Where descriptions of arms that do not ship are written.
    """
    found = _VARIANT.fullmatch(name)
    return (
        load_robot(name) if found is None else slower(load_robot(found["arm"]), int(found["share"]), folder)
    )


def slower(robot: Robot, percent: int, folder: Path) -> Robot:
    """The same arm with so many percent of its speed limits; written below `folder`.

    Raises
    ------
    UserError
        If it would be faster, or not move at all.
    """
    if not 0 < percent <= 100:
        raise UserError(f"{robot.name} with {percent} % of its speed: give 1 to 100")
    name = f"{robot.name}_{percent}_percent"
    sheet = yaml.safe_load((robot.folder / SHEET_FILE).read_text(encoding="utf-8"))
    sheet["name"] = name
    limits = sheet["limits"]
    limits["speed_rad_s"] = [round(speed * percent / 100, 6) for speed in limits["speed_rad_s"]]
    (folder / name).mkdir(parents=True, exist_ok=True)
    write_atomically(folder / name / DESCRIPTION_FILE, (robot.folder / DESCRIPTION_FILE).read_bytes())
    write_atomically(folder / name / SHEET_FILE, yaml.safe_dump(sheet, sort_keys=False).encode())
    return load_robot(folder / name)
