"""The verbs of ``python -m msrd_ros.bags`` that list a folder's strokes and edit its bags."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from msrd_ros.contract.labels import UNLABELLED
from msrd_ros.contract.topics import parse_topic_names
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.found_strategies import FoundStrategies
from msrd_ros.recordings.journal import Edit
from msrd_ros.recordings.row import ACCEPTED, Row
from msrd_ros.recordings.table import StrokeTable
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot

_LAST = math.inf
"""Where what is not known is sorted."""

SORT: Mapping[str, Callable[[Row], tuple[object, ...]]] = {
    "bag": lambda row: (row.bag,),
    "subject": lambda row: (row.subject, row.bag),
    "label": lambda row: (row.label, row.bag),
    "verdict": lambda row: (row.verdict != ACCEPTED, row.verdict, row.bag),
    "length": lambda row: (_LAST if row.length_s is None else row.length_s, row.bag),
    "spin": lambda row: (_LAST if row.spin_rad_s is None else row.spin_rad_s[1], row.bag),
    "landing": lambda row: (_LAST if row.landing_m is None else row.landing_m[0], row.bag),
    "jerk": lambda row: (_LAST if row.jerk_rad_s3 is None else -row.jerk_rad_s3, row.bag),
    "distance": lambda row: (_LAST if row.distance_rad is None else -row.distance_rad, row.bag),
}
"""What a list can be sorted by; of jerk and distance the largest comes first, what is not known last."""

_HEAD = ("bag", "subject", "label", "s", "spin rad/s", "landing m", "verdict", "remarks")


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """What it takes to read strangers' bags: ``--robot`` and ``--topics``."""
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="the arm that was led: a name or a folder")
    parser.add_argument(
        "--topics",
        action="append",
        default=[],
        metavar="NAME:=NAME_IN_BAG",
        help="what a topic is called in the bags; may be given several times",
    )


def read_options(options: argparse.Namespace) -> tuple[Robot, dict[str, str]]:
    """The arm, and full topic names by relative name, as the options say."""
    return load_robot(options.robot), parse_topic_names(options.topics, "--topics")


def add_editing_verbs(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verbs ``list``, ``relabel``, ``trim``, ``flag``, ``unflag``, ``discard`` and ``restore``."""
    table = verbs.add_parser("list", help="show a folder's strokes as a table")
    table.add_argument("folder", type=Path, metavar="FOLDER", help="a folder of bags, a bag or an MCAP file")
    add_reading_options(table)
    table.add_argument("--sort", choices=SORT, default="bag", help="by what; 'bag' if left out")
    table.add_argument(
        "--label",
        action="append",
        default=[],
        help=f"only this label, or {UNLABELLED}; may be given again",
    )
    table.add_argument("--subject", action="append", default=[], help="only this subject; may be given again")
    table.add_argument("--outliers", action="store_true", help="only what stands out from its label's others")
    table.add_argument("--discarded", action="store_true", help="only what is discarded")
    table.add_argument("--json", action="store_true", help="print one object a stroke, and nothing else")
    table.set_defaults(run=_list)

    one = _edit(verbs, "relabel", "give a bag another label", lambda c, o: c.relabel(o.bag, o.label))
    one.add_argument(
        "label",
        metavar="LABEL",
        nargs="?",
        help=f"any name of a-z, 0-9 and hyphen; {UNLABELLED} takes it away",
    )
    one.add_argument(
        "--from",
        dest="found",
        type=Path,
        metavar="FILE",
        help="instead of LABEL: the strategies.json whose names all bags of the folder BAG get",
    )
    one.set_defaults(run=_relabel, relabel_one=one.get_default("run"))
    one = _edit(verbs, "trim", "keep a part of a bag", lambda c, o: c.trim(o.bag, o.begin_s, o.end_s))
    one.add_argument("begin_s", type=float, metavar="BEGIN", help="s from the bag's start")
    one.add_argument("end_s", type=float, metavar="END", help="s from the bag's start")
    one = _edit(verbs, "flag", "note something about a bag", lambda c, o: c.flag(o.bag, o.text))
    one.add_argument("text", metavar="TEXT", help="one line")
    one = _edit(verbs, "unflag", "take a note off a bag", lambda c, o: c.unflag(o.bag, o.text))
    one.add_argument("text", metavar="TEXT", nargs="?", help="which note; all if left out")
    _edit(verbs, "discard", "move a bag aside", lambda c, o: c.discard(o.bag))
    _edit(
        verbs, "restore", "take back a bag's last edit, or the edit FOLDER/ID", lambda c, o: c.restore(o.bag)
    )


def _edit(
    verbs: argparse._SubParsersAction[argparse.ArgumentParser],
    verb: str,
    meaning: str,
    edit: Callable[[Curation, argparse.Namespace], Edit],
) -> argparse.ArgumentParser:
    def run(options: argparse.Namespace) -> int:
        curation = Curation.of(options.bag, *read_options(options))
        done = edit(curation, options)
        _tell(curation.mended)
        print(done)
        return 0

    parser = verbs.add_parser(verb, help=meaning)
    parser.add_argument("bag", type=Path, metavar="BAG", help="directory or MCAP file of the bag")
    add_reading_options(parser)
    parser.set_defaults(run=run)
    return parser


def _relabel(options: argparse.Namespace) -> int:
    if (options.label is None) == (options.found is None):
        raise UserError("give a LABEL for one bag, or --from FILE for a folder")
    if options.found is None:
        return int(options.relabel_one(options))
    edits = 0
    found = FoundStrategies.read(options.found)
    for edit in found.relabel(options.bag, *read_options(options), lambda note: _tell([note])):
        print(edit)
        edits += 1
    print(f"{edits} edit{'s' * (edits != 1)}")
    return 0


def _list(options: argparse.Namespace) -> int:
    table = StrokeTable(options.folder, *read_options(options))
    rows = [
        row
        for row in table.rows(options.discarded)
        if (not options.label or row.label in options.label)
        and (not options.subject or row.subject in options.subject)
        and (row.marks or not options.outliers)
        and bool(row.discarded) == options.discarded
    ]
    rows.sort(key=SORT[options.sort])
    _tell(table.notes)
    if options.json:
        print(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        for line in _lines(rows):
            print(line)
        accepted = sum(row.verdict == ACCEPTED for row in rows)
        outliers = sum(bool(row.marks) for row in rows)
        print(
            f"{len(rows)} stroke{'s' * (len(rows) != 1)}, {accepted} accepted, {outliers} marked as outliers"
        )
    return 0 if rows else 1


def _tell(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


def _lines(rows: Sequence[Row]) -> list[str]:
    """A table with columns as wide as what is in them; the last one, which may be long, is not filled up."""
    cells = [_HEAD, *map(_cells, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(map(str.ljust, line, widths)).rstrip() for line in cells]


def _cells(row: Row) -> tuple[str, ...]:
    remarks = [
        *([f"was {row.discarded}"] if row.discarded else []),
        *([row.does] if row.label == UNLABELLED and row.does else []),
        *row.flags,
        *row.marks,
        *([row.detail] if row.detail else []),
    ]
    return (
        row.bag,
        row.subject,
        row.label,
        "" if row.length_s is None else f"{row.length_s:.2f}",
        "" if row.spin_rad_s is None else f"{row.spin_rad_s[1]:.0f}",
        "" if row.landing_m is None else "{:.2f}, {:.2f}".format(*row.landing_m),
        row.verdict,
        "; ".join(remarks),
    )
