"""The verbs ``export`` and ``import`` of ``python -m msrd_ros.bags``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from msrd_ros.recordings.editing_command import add_reading_options, read_options
from msrd_ros.recordings.exchange.exporting import export_bags
from msrd_ros.recordings.exchange.importing import import_bags, import_columns
from msrd_ros.recordings.exchange.kinds import KINDS


def add_exchange_verbs(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verbs ``export`` and ``import``."""
    out = verbs.add_parser("export", help="make a data set of a folder's strokes, with the bags beside it")
    out.add_argument("--to", choices=KINDS, required=True, help="whose data set")
    out.add_argument("bags", type=Path, metavar="BAGS", help="a folder of bags, a bag or an MCAP file")
    out.add_argument("target", type=Path, metavar="OUT", help="the data set's new folder")
    add_reading_options(out)
    out.add_argument("--video", action="store_true", help="draw the simulator's picture of every row")
    out.set_defaults(run=_export)
    back = verbs.add_parser("import", help="make bags of a data set: those it was made of, or of its columns")
    back.add_argument("--from", dest="kind", choices=KINDS, required=True, help="whose data set")
    back.add_argument("source", type=Path, metavar="IN", help="the data set's folder")
    back.add_argument("target", type=Path, metavar="OUT", help="the new folder of bags")
    back.add_argument(
        "--mapping", type=Path, metavar="FILE", help="what columns are; then bags are made of them"
    )
    back.add_argument(
        "--robot", help="the arm, a name or a folder; the one that IN or FILE names if left out"
    )
    back.set_defaults(run=_import)


def _export(options: argparse.Namespace) -> int:
    robot, names = read_options(options)
    done = export_bags(options.bags, options.target, options.to, robot, names, options.video)
    for name, reason in done.refused.items():
        print(f"note: {name}: {reason}; kept beside the data set alone", file=sys.stderr)
    print(f"{options.target}: {_count(len(done.strokes), 'episode')} of {_count(len(done.bags), 'bag')}")
    return 0


def _import(options: argparse.Namespace) -> int:
    if options.mapping is None:
        done = import_bags(options.source, options.target, options.kind, options.robot)
    else:
        done = import_columns(options.source, options.target, options.kind, options.mapping, options.robot)
    for line in done.refused:
        print(f"note: {line}", file=sys.stderr)
    print(f"{options.target}: {_count(done.bags, 'bag')}, {len(done.refused)} episodes refused")
    return 0


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
