"""The command ``python -m msrd_ros.bags``: check, repair, list, edit, export and import bags."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from msrd_ros.bags.repair import repair
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.check import check, write_json
from msrd_ros.recordings.editing_command import add_editing_verbs, add_reading_options, read_options
from msrd_ros.recordings.exchange.command import add_exchange_verbs

ACCEPTED, REFUSED, WRONG_CALL = 0, 1, 2


def main(arguments: list[str] | None = None) -> int:
    """Run the command; its exit status.

    Returns
    -------
    0 if all bags are accepted, what was cut off is recovered, strokes are listed, or an edit is done; 1 if a
    bag is refused or there is none; 2 for a wrong call, or where nothing can be recovered or edited.
    """
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except UserError as error:
        print(f"{options.verb}: error: {_as_option(str(error))}", file=sys.stderr)
        return WRONG_CALL
    except BrokenPipeError:
        return REFUSED  # who reads the list has had enough


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m msrd_ros.bags", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    one = verbs.add_parser("check", help="say which bags may serve as demonstrations, and why others may not")
    one.add_argument("path", type=Path, metavar="PATH", help="a folder of bags, a bag or an MCAP file")
    add_reading_options(one)
    one.add_argument("--json", action="store_true", help="print one object a bag, and nothing else")
    one.set_defaults(run=_check)
    other = verbs.add_parser("repair", help="recover what is left of a recording that was cut off")
    other.add_argument("bag", type=Path, metavar="BAG", help="directory or MCAP file of the broken bag")
    other.add_argument(
        "target", type=Path, nargs="?", help="directory of the new bag; BAG_repaired if left out"
    )
    other.set_defaults(run=_repair)
    add_editing_verbs(verbs)
    add_exchange_verbs(verbs)
    return parser


def _check(options: argparse.Namespace) -> int:
    checked = check(options.path, *read_options(options))
    if options.json:
        print(_as_option(write_json(checked)))
    else:
        for one in checked:
            print(_as_option(str(one)))
        refused = sum(one.refused is not None for one in checked)
        strokes = sum(one.strokes for one in checked)
        print(f"{len(checked)} bags, {strokes} strokes accepted, {refused} bags refused")
    return ACCEPTED if checked and all(one.refused is None for one in checked) else REFUSED


def _repair(options: argparse.Namespace) -> int:
    print(repair(options.bag, options.target))
    return ACCEPTED


def _as_option(text: str) -> str:
    """Remedies that errors name for nodes, as they are said to this command."""
    return text.replace("robot:=", "--robot ")
