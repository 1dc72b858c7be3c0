"""A data set to bags: those that were exported, byte for byte, or strokes made of the columns of any."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from msrd_ros import __version__
from msrd_ros.contract.columns import DataContract
from msrd_ros.contract.topics import CONTRACT, BagTopic
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.beside import (
    CONTRACT_FILE,
    FOLDER,
    Beside,
    copy_back,
    kept_path,
    read_beside,
)
from msrd_ros.recordings.exchange.from_columns import make_strokes
from msrd_ros.recordings.exchange.kinds import KINDS, whole_or_absent
from msrd_ros.recordings.exchange.stroke_set import BAG, STROKE, accepted
from msrd_ros.recordings.exchange.table import Table
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.store import StrokeStore
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot


class Imported(NamedTuple):
    """What an import made.

    Attributes
    ----------
    bags
        How many.
    refused
        One line for every episode of which no bag was made.
    """

    bags: int
    refused: tuple[str, ...] = ()


def import_bags(source: Path, target: Path, kind: str, robot: Path | str | None = None) -> Imported:
    """Take the bags back that a data set was made of, byte for byte.

    Its rows have to be those that its bags give, bit for bit: what was changed in it would be lost.

    Parameters
    ----------
    source
        The data set's folder.
    target
        The folder of bags, which does not exist yet.
    kind
        ``lerobot`` or ``minari``.
    robot
        The arm that was led; the one that the data set names if None.

    Raises
    ------
    UserError
        If no bags are kept beside it, or bags or rows have been changed; says the way out.
    """
    beside = read_beside(source)
    arm = _robot(beside.robot, robot, f"data set {source}")
    _require_unchanged(KINDS[kind].read(source), beside, arm, source, kind)
    with whole_or_absent(target) as aside:
        for bag in beside.bags:
            copy_back(source, bag, aside)
    return Imported(len(beside.bags))


def import_columns(
    source: Path, target: Path, kind: str, mapping: Path, robot: Path | str | None = None
) -> Imported:
    """Make bags of a data set's columns, whoever wrote it.

    Every episode is inspected like any stroke; of one that is not accepted no bag is made.

    Parameters
    ----------
    source
        The data set's folder.
    target
        The folder of bags, which does not exist yet.
    kind
        ``lerobot`` or ``minari``.
    mapping
        The file that says what its columns are.
    robot
        The arm; the one that the mapping names if None.

    Raises
    ------
    UserError
        If mapping and data set do not go together, or no episode is accepted; names key and feature.
    """
    contract = DataContract.read(mapping)
    where = f"mapping {mapping}"
    arm = _robot(contract.robot, robot, where)
    table = KINDS[kind].read(source)
    refused: list[str] = []
    count = 0
    topics = {
        role: BagTopic(f"/{role}", facts.type_name, latched=facts.latched, depth=facts.depth)
        for role, facts in CONTRACT.items()
    }
    with whole_or_absent(target) as aside:
        store = StrokeStore(aside, arm, InspectionLimits(), f"msrd_ros {__version__}")
        for made in make_strokes(table, contract, arm, where):
            note = f"made of {table.where}, episode {made.number}"
            kept = store.keep(made.stroke, made.subject, topics, {}, note=note, unlabelled=True)
            count += kept.verdict.accepted
            if not kept.verdict.accepted:
                refused.append(f"episode {made.number}: {kept.verdict.reason}, {kept.verdict.detail}")
        if not count:
            raise UserError(f"{table.where}: no episode is accepted; {(refused or ['it has none'])[0]}")
    return Imported(count, tuple(refused))


def _robot(named: str, given: Path | str | None, where: str) -> Robot:
    """The arm that a file names, or that was given; an identity has to be the arm's."""
    name, separator, _ = named.partition("@")
    robot = load_robot(name if given is None else given)
    if separator:
        robot.require(named, where)
    return robot


def _require_unchanged(table: Table, beside: Beside, robot: Robot, source: Path, kind: str) -> None:
    """Refuse a data set whose rows are not those of its bags."""
    features = list(dict.fromkeys(columns.feature for columns in KINDS[kind].contract(robot).columns))
    episodes = table.episodes(features)
    found = {(episode.facts.get(BAG), int(episode.facts.get(STROKE, -1))): episode for episode in episodes}
    way_out = (
        f"to make bags of its rows instead, say --mapping {source / FOLDER / CONTRACT_FILE}, or a mapping "
        "of your own"
    )
    expected = {(bag.path, number) for bag in beside.bags for number in range(bag.strokes)}
    if set(found) != expected or len(episodes) != len(expected):
        raise UserError(
            f"{table.where}: its {len(episodes)} episodes are not the {len(expected)} strokes of the bags "
            f"beside it; {way_out}"
        )
    for bag in beside.bags:
        strokes = accepted(kept_path(source, bag), robot, beside.topics)[0] if bag.strokes else ()
        for number, stroke in enumerate(strokes):
            episode = found[bag.path, number]
            for feature, rows in table.of_stroke(stroke).items():
                if not np.array_equal(rows, episode.rows[feature]):
                    raise UserError(
                        f"{table.where}: episode {episode.number}: {feature} is not what the bag {bag.path} "
                        f"beside it gives; {way_out}"
                    )
