"""What Ray costs beside processes on one machine, and what a cluster would take by the costs of its parts.

Run from the repository: ``python benchmarks/ray_overhead.py [--pairs 12] [--balls 96]``. The work is what the
trainer's `rollouts` do: balls in Bullet, against policies of random weights, in units of `BALLS_PER_UNIT`.
Processes, one process and Ray play the same balls by turns, again and again in changing order, so that other
work on the machine meets all of them alike; ratios are those of neighbours.
"""

from __future__ import annotations

import argparse
import math
import os
import pickle
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

CHECKOUT = Path(__file__).resolve().parent.parent
# Policies and units made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]
os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:2])

import units  # noqa: E402
from made_up_policies import made_up_policies  # noqa: E402
from msrd_ros.cluster.on_ray import RayWorkers  # noqa: E402
from msrd_ros.cluster.processes import Processes, ThisProcess  # noqa: E402
from msrd_ros.cluster.workers import Workers  # noqa: E402
from msrd_ros.table_tennis.simulation.world import WorldConfig  # noqa: E402
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS  # noqa: E402
from msrd_ros.table_tennis.strokes.rollouts import (  # noqa: E402
    BALLS_PER_UNIT,
    BulletPlayers,
    StrokeBatch,
)

EMPTY_UNITS = 400
EPISODES = 200
"""Of each strategy in an iteration, as the recipe has it."""
CLUSTERS = (1, 2, 5, 10, 20, 50, 100)
NETWORK_BYTES_S = 125e6
"""Of 1 Gbit/s, through which all goes that the directing machine sends and hears: assumed, not measured."""
PROCESSORS_OF_A_MACHINE = 10
"""Likewise."""


class Costs(NamedTuple):
    """Of the parts: bytes of policies and of a unit's answer; seconds."""

    policy_bytes: int
    answer_bytes: int
    share_s: float
    hand_out_s: float
    unit_s: float


def batch(balls: int, seed: int = 1) -> StrokeBatch:
    """Strokes of all labels in equal parts."""
    return StrokeBatch.draw(
        made_up_policies(), balls // len(ALL_LABELS), "standard", 0.03, 0, np.random.default_rng(seed)
    )


def seconds(work: Callable[[], object]) -> float:
    """How long it takes."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def spread(values: list[float], unit: str) -> str:
    """Median and quartiles."""
    low, middle, high = np.percentile(values, (25, 50, 75))
    return f"{middle:.3f} ({low:.3f} to {high:.3f}){unit}"


def side_by_side(places: dict[str, Workers], pairs: int, balls: int) -> dict[str, list[float]]:
    """Seconds of the same balls at each place, round by round."""
    strokes = batch(balls)
    players = {name: BulletPlayers(workers, WorldConfig()) for name, workers in places.items()}
    # Opens all worlds, and holds to each other what is played in them.
    first = [player.play(batch(4 * BALLS_PER_UNIT, 0)) for player in players.values()]
    for same in zip(*first, strict=True):
        assert all(np.array_equal(episode.actions, same[0][0].actions) for episode, _ in same)
    took: dict[str, list[float]] = defaultdict(list)
    order = list(players)
    for number in range(pairs):
        for name in order if number % 2 else reversed(order):
            took[name].append(seconds(lambda player=players[name]: player.play(strokes)))  # type: ignore[misc]
    return took


def ratios(took: dict[str, list[float]], upper: str, lower: str) -> list[float]:
    """Round by round."""
    return [a / b for a, b in zip(took[upper], took[lower], strict=True)]


def parts(workers: Workers, unit_s: float) -> Costs:
    """What handing out costs, by itself."""
    policies = batch(BALLS_PER_UNIT).policies.to_bytes()
    answer = pickle.dumps(BulletPlayers(ThisProcess(), WorldConfig()).play(batch(BALLS_PER_UNIT)))
    nothing = [(number,) for number in range(EMPTY_UNITS)]
    workers.map(units.square, nothing, 1)
    share_s = float(np.median([seconds(lambda: workers.share(policies)) for _ in range(20)]))
    hand_out_s = float(np.median([seconds(lambda: workers.map(units.square, nothing, 1)) for _ in range(5)]))
    return Costs(len(policies), len(answer), share_s, hand_out_s / EMPTY_UNITS, unit_s)


def on_paper(costs: Costs, workers: int) -> tuple[float, float]:
    """Seconds of an iteration's rollouts on so many workers, and how many of them that keeps at work.

    Whoever hands out does one unit after the other: the last worker begins once all others have, and its
    bytes go through one network. The last round of units is waited for.
    """
    count = math.ceil(EPISODES * len(ALL_LABELS) / BALLS_PER_UNIT)
    machines = math.ceil(workers / PROCESSORS_OF_A_MACHINE)
    sent_s = costs.policy_bytes * machines / NETWORK_BYTES_S
    each_s = costs.hand_out_s + costs.answer_bytes / NETWORK_BYTES_S
    rounds_s = math.ceil(count / workers) * costs.unit_s
    took_s = costs.share_s + sent_s + min(workers, count) * each_s + max(rounds_s, count * each_s)
    return took_s, count * costs.unit_s / took_s


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=12, help="rounds of the comparison")
    parser.add_argument("--balls", type=int, default=96, help="balls of a round at each place")
    parser.add_argument("--workers", type=int, default=2)
    words = parser.parse_args()
    print(f"load of the machine at the start: {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores", flush=True)
    with ExitStack() as stack:
        places: dict[str, Workers] = {
            "processes": stack.enter_context(Processes(words.workers)),
            "one process": stack.enter_context(Processes(1)),
            "Ray": stack.enter_context(RayWorkers(None, words.workers)),
        }
        took = side_by_side(places, words.pairs, words.balls)
        for name, values in took.items():
            print(f"{words.balls} balls, {name:12s} {spread(values, ' s')}", flush=True)
        print(f"Ray / processes, {words.workers} each   {spread(ratios(took, 'Ray', 'processes'), '')}")
        for name in ("processes", "Ray"):
            print(
                f"one process / {words.workers} of {name:10s} {spread(ratios(took, 'one process', name), '')}"
            )
        unit_s = float(np.median(took["one process"])) * BALLS_PER_UNIT / words.balls
        costs = {name: parts(places[name], unit_s) for name in ("processes", "Ray")}
    for name, cost in costs.items():
        print(
            f"{name}: {cost.policy_bytes} bytes of policies, shared in {1000 * cost.share_s:.2f} ms\n"
            f"  a unit of {BALLS_PER_UNIT} balls: {cost.unit_s:.3f} s, {cost.answer_bytes} bytes of answer, "
            f"{1000 * cost.hand_out_s:.2f} ms to hand out and take back"
        )
    print("on paper, an iteration's rollouts on Ray: workers, seconds, workers kept at work")
    for workers in CLUSTERS:
        took_s, at_work = on_paper(costs["Ray"], workers)
        print(f"{workers:4d} {took_s:8.2f} {at_work:8.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
