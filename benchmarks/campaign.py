"""Plays a campaign of faults against the real stack, and writes a table of what held.

Run from the repository: ``python benchmarks/campaign.py [--share 1] [--only TRIAL ...] [--out FOLDER]``, or
``make campaign``. With share 1 it takes about 45 minutes; started again with the same share and seed it
goes on where it was stopped. Exit status: 0 if every promise held, 1 if one was broken.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
# Policies, processes and domains made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

from faults import clocks, files, messages, nodes  # noqa: E402
from faults.trials import run_trials, write_table  # noqa: E402

TRIALS = (*files.TRIALS, *nodes.TRIALS, *messages.TRIALS, *clocks.TRIALS)


def main() -> int:
    """Run what is asked for; exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--share", type=float, default=1.0, help="of the whole campaign's counts")
    parser.add_argument("--only", nargs="*", default=[], choices=[trial.name for trial in TRIALS])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/campaign"))
    options = parser.parse_args()
    if not 0.0 < options.share <= 1.0:
        parser.error(f"--share {options.share:g}: give more than 0 and at most 1")
    trials = [trial for trial in TRIALS if not options.only or trial.name in options.only]
    entries = run_trials(trials, options.out.absolute(), options.share, options.seed)
    table = options.out / "campaign.md"
    write_table(trials, entries, table)
    print(f"written to {table}")
    return int(any(entry.finding is not None and entry.finding.broken for entry in entries))


if __name__ == "__main__":
    sys.exit(main())
