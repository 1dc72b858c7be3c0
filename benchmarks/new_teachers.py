"""Teachers that come after training: what they are taken for, how they are played, what becomes of the rest.

Run from the repository: ``python benchmarks/new_teachers.py [--only NAME ...] [--seeds 5]``. Prints one line
of JSON for each case, and last the means of each part:

* ``strokes``: teachers between push and slice, between slice and topspin, and one who lobs, of a population
  that nothing was tuned on, come to a trainer's run on the bags that ship (``python -m msrd_ros trainer
  --ros-args -p out:=out/new_teachers -p corrective_cloning:=true``); recorded and played in Bullet in this
  process, as over the topics.
* ``service``: three recorded strokes under new names; seconds from the recorder's verdict until an executor
  has the policies of the serving trainer, over the topics.
* ``pendulum``: MSRD learns 16 of the 20 DIAYN strategies and meets the others, from one demonstration each;
  task r and strategy r by the truth, before and after, by the study's own measure.
* ``stream``: 100 teachers in a row come to 5 of them: each of the 20 or a mixture of two, by chance.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from newcomers.pendulum import pendulum
from newcomers.service import service
from newcomers.stream import stream
from newcomers.strokes import strokes

PARTS = {"strokes": strokes, "service": service, "pendulum": pendulum, "stream": stream}


def means(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Of all figures that are plain numbers."""
    numbers = [key for key, value in rows[0].items() if isinstance(value, int | float) and key != "seed"]
    return {key: round(float(np.mean([row[key] for row in rows])), 4) for key in numbers}


def main() -> None:
    """Run the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--run", type=Path, default=Path("out/new_teachers"), help="a trainer's folder")
    options = parser.parse_args()
    torch.set_num_threads(1)
    for name in options.only:
        rows: list[dict[str, Any]] = []
        for row in PARTS[name](options.seeds, options.run):
            rows.append(row)
            print(json.dumps({"part": name, **row}), flush=True)
        for count in (1, 3) if name == "strokes" else (None,):
            group = [row for row in rows if row.get("recordings") == count]
            print(json.dumps({"part": name, "cases": len(group), "means": means(group)}), flush=True)


if __name__ == "__main__":
    main()
