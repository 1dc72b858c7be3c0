"""``python -m msrd_ros rally``: let two arms play each other, and report how long their rallies are."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import write_report as write_metrics
from msrd_ros.rally.play import play_rallies
from msrd_ros.rally.report import figures, summary, write_report
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.strokes.policies import StrokePolicies, rally_policies


def main(arguments: Sequence[str] | None = None) -> int:
    """Play, print the figures, and write ``report.html``, ``metrics.json`` and the film."""
    parser = argparse.ArgumentParser(
        prog="msrd_ros rally", description="Two arms at one table play rallies; in process, without topics."
    )
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="name of a shipped arm, or its folder")
    parser.add_argument("--checkpoint", help="policies of both arms; default: those shipped for rallies")
    parser.add_argument("--rallies", type=int, default=100, help="how many (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of feeds and camera (default %(default)s)")
    parser.add_argument("--spread", default="standard", choices=list(SPREADS), help="of the feeds")
    parser.add_argument("--out", default="out/rally", help="folder of what is written (default %(default)s)")
    options = parser.parse_args(arguments)
    if options.rallies < 1 or options.seed < 0:
        raise UserError(
            f"rally: --rallies {options.rallies}, --seed {options.seed}: give 1 or more, and 0 or more"
        )
    robot = load_robot(options.robot)
    given = options.checkpoint
    policies = StrokePolicies.load(Path(given), robot) if given else rally_policies(robot)
    out = Path(options.out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {out}: cannot write there ({error.strerror}); choose another") from None
    played, exceeded = play_rallies(
        policies, options.rallies, options.seed, options.spread, lambda line: print(line, flush=True)
    )
    metrics = {
        **figures(played),
        "limits_exceeded": exceeded,
        "seed": options.seed,
        "spread": options.spread,
        "robot": robot.name,
        "policies": policies.digest,
    }
    write_metrics(out / "metrics.json", metrics)
    print(summary(metrics))
    write_report(out, played, metrics, robot)
    print(f"\nreport: {out / 'report.html'}")
    return 0
