"""``python -m msrd_ros learn-rally``: learn the policies of rallies for an arm."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import torch

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.rally.learn import RallyLearning, RallyLearningConfig
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn, and write the policies after each round."""
    config = RallyLearningConfig()
    parser = argparse.ArgumentParser(
        prog="msrd_ros learn-rally", description="Learn strokes against the balls that they bring back."
    )
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="name of a shipped arm, or its folder")
    parser.add_argument("--rounds", type=int, default=config.rounds, help="default %(default)s")
    parser.add_argument("--balls", type=int, default=config.balls, help="a generation; default %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="everything random follows from it")
    parser.add_argument("--out", default="out/rally/rally.safetensors", help="file of the policies")
    options = parser.parse_args(arguments)
    if options.rounds < 1 or options.balls < 1 or options.seed < 0:
        raise UserError("learn-rally: give --rounds and --balls of 1 or more, and a --seed of 0 or more")
    torch.set_num_threads(1)
    out, begun_s = Path(options.out), time.monotonic()
    learning = RallyLearning(
        load_robot(options.robot),
        RallyLearningConfig(rounds=options.rounds, balls=options.balls),
        options.seed,
    )
    for number in range(options.rounds):
        shares = learning.run_round()
        write_atomically(out, learning.policies().to_bytes())
        told = "; ".join(
            f"{label} {' '.join(f'{share:.1%}' for share in each)}" for label, each in shares.items()
        )
        print(
            f"round {number + 1} of {options.rounds}, {time.monotonic() - begun_s:.0f} s: returned in each "
            f"generation {told}",
            flush=True,
        )
    print(f"written to {out}")
    return 0
