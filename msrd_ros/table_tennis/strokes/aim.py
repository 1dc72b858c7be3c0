"""``python -m msrd_ros aim POLICIES OUT``: teach policies to land their balls where they are told."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import torch

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.strokes.aiming import AimingConfig, aim
from msrd_ros.table_tennis.strokes.policies import StrokePolicies


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn targets for a file of policies, and write another."""
    parser = argparse.ArgumentParser(
        prog="msrd_ros aim",
        description="Teach policies to land their balls where they are told, from their own rollouts in the "
        "batched simulator.",
    )
    parser.add_argument("policies", type=Path, help="policies.safetensors of a training")
    parser.add_argument("out", type=Path, help="file to write")
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="the arm that plays them, as of the nodes")
    parser.add_argument("--seed", type=int, default=AimingConfig.seed)
    parser.add_argument(
        "--spread", choices=tuple(SPREADS), default=AimingConfig.spread, help="of the feeds learned from"
    )
    parser.add_argument("--threads", type=int, default=AimingConfig.threads, help="of the simulator")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    options = parser.parse_args(arguments)
    if options.seed < 0 or options.threads < 1:
        raise UserError("--seed is a whole number from 0, --threads one from 1; give others")
    if options.out.exists() and not options.overwrite:
        raise UserError(f"{options.out} is there already; give another file, or --overwrite")
    torch.set_num_threads(1)
    policies = StrokePolicies.load(options.policies, load_robot(options.robot))
    config = AimingConfig(seed=options.seed, spread=options.spread, threads=options.threads)
    aimed = aim(policies, config, lambda line: print(line, flush=True))
    write_atomically(options.out, aimed.to_bytes())
    for line in say_reach(aimed):
        print(line)
    print(f"written to {options.out}")
    return 0


def say_reach(policies: StrokePolicies) -> list[str]:
    """A line for each strategy that takes a target."""
    return [
        f"{label}: {facts.reach.hits.sum()} of {facts.reach.hits.size} targets in reach"
        for label, facts in policies.facts.items()
        if facts.reach is not None
    ]
