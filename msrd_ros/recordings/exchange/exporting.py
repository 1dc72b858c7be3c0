"""Bags to a data set: whole, or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.beside import keep_beside
from msrd_ros.recordings.exchange.kinds import KINDS, whole_or_absent
from msrd_ros.recordings.exchange.stroke_set import StrokeSet, read_stroke_set
from msrd_ros.robots.robot import Robot


def export_bags(
    folder: Path, target: Path, kind: str, robot: Robot, names: Mapping[str, str], video: bool = False
) -> StrokeSet:
    """Make a data set of the accepted strokes in a folder, with all its bags beside them.

    Parameters
    ----------
    folder
        Of bags; or one bag, or an MCAP file.
    target
        The data set's folder, which does not exist yet.
    kind
        ``lerobot`` or ``minari``.
    robot
        The arm that was led.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.
    video
        Draw the simulator's picture of every row: of joints and ball, not of a camera.

    Returns
    -------
    What was written, and what was refused.

    Raises
    ------
    UserError
        If nothing is accepted, the target exists, lies in `folder` or cannot be written, the kind holds no
        pictures, or a library is not installed.
    """
    if target.resolve().is_relative_to(folder.resolve()):
        raise UserError(
            f"{target}: lies in {folder}, whose strokes would count twice then; name a folder elsewhere"
        )
    strokes = read_stroke_set(folder, robot, names)
    with whole_or_absent(target) as aside:
        KINDS[kind].write(aside, strokes, target.name, video)
        keep_beside(aside, strokes, KINDS[kind].contract(robot))
    return strokes
