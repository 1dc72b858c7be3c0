"""How many strokes a second the simulators play, and how much faster than real time that is.

Run from the repository: ``python benchmarks/simulator.py [--episodes 48] [--workers 1 2]``. An episode is one
ball against a policy of random weights: about two seconds of simulated time, played in Bullet in worker
processes, in the batched simulator, and over ROS 2 topics in lockstep through executor and simulator.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

CHECKOUT = Path(__file__).resolve().parent.parent
# Policies and processes made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

from made_up_policies import made_up_policies  # noqa: E402
from msrd_ros.cluster.processes import Processes, ThisProcess  # noqa: E402
from msrd_ros.nodes.topic_rollouts import TopicCollector  # noqa: E402
from msrd_ros.table_tennis.simulation.batched import (  # noqa: E402
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
)
from msrd_ros.table_tennis.simulation.world import WorldConfig  # noqa: E402
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS  # noqa: E402
from msrd_ros.table_tennis.strokes.rollouts import (  # noqa: E402
    BALLS_PER_UNIT,
    BulletPlayers,
    StrokeBatch,
)
from stack import Stack  # noqa: E402

DOMAIN_ID = 96
STROKE_S = 1.96
"""Simulated seconds from the launch to the outcome of nearly every ball."""
BATCHED_EPISODES = 200


class Rate(NamedTuple):
    """What was played, and how many episodes a second."""

    what: str
    episodes: float

    @property
    def real_time(self) -> float:
        """Simulated seconds a second."""
        return self.episodes * STROKE_S


Clock = Callable[[], float]
"""In seconds: of the wall, or of this process's use of the processor, which other work does not slow down."""


def timed(what: str, episodes: int, work: Callable[[], object], clock: Clock = time.perf_counter) -> Rate:
    """Time some episodes, after they have been played once to compile and to connect."""
    begin = clock()
    work()
    return Rate(what, episodes / (clock() - begin))


def batch(episodes: int, seed: int) -> StrokeBatch:
    """Strokes of all labels in equal parts."""
    each = max(episodes // len(ALL_LABELS), 1)
    return StrokeBatch.draw(made_up_policies(), each, "standard", 0.03, 0, np.random.default_rng(seed))


def in_bullet(workers: Sequence[int], episodes: int, clock: Clock = time.perf_counter) -> Iterator[Rate]:
    """Bullet in this process, or in several that work for it."""
    for count in workers:
        with ThisProcess() if count == 1 else Processes(count) as processes:
            players = BulletPlayers(processes, WorldConfig())
            players.play(batch(BALLS_PER_UNIT * count, 0))
            strokes = batch(episodes, 1)
            name = f"Bullet in process, {count} worker{'s' if count > 1 else ''}"
            yield timed(name, len(strokes.strokes), lambda p=players, s=strokes: p.play(s), clock)  # type: ignore[misc]


def batched(threads: Sequence[int], clock: Clock = time.perf_counter) -> Iterator[Rate]:
    """The batched simulator, with random actions."""
    facts = made_up_policies().facts
    plans = [RallyPlan(fact.side, fact.ready_pose) for fact in facts.values()]
    for count in threads:
        simulator = KinematicRallies(plans, KinematicRalliesConfig(threads=count))

        def play(simulator: KinematicRallies = simulator) -> None:
            rng = np.random.default_rng(1)
            simulator.reset(len(plans), BATCHED_EPISODES, rng)
            for _ in range(simulator.horizon):
                simulator.step(rng.uniform(-0.3, 0.3, (len(plans), BATCHED_EPISODES, 7)))
            simulator.results()

        play()
        name = f"batched simulator, {count} thread{'s' if count > 1 else ''}"
        yield timed(name, len(plans) * BATCHED_EPISODES, play, clock)


class Topics(NamedTuple):
    """What was played over topics, and milliseconds of the processor that a tick took in either process."""

    rate: Rate
    tick_ms: dict[str, float]


def over_topics(episodes: int) -> Topics:
    """Lockstep through executor and simulator, each a process."""
    with tempfile.TemporaryDirectory() as folder, Stack(DOMAIN_ID, folder) as stack:
        nodes = {"simulator": stack.start_simulator(show=False), "executor": stack.start("executor")}
        collector = TopicCollector(stack.node, made_up_policies, "standard", 0.03, 120.0)

        def play(strokes: StrokeBatch) -> None:
            thread = threading.Thread(target=collector.play, args=(strokes,))
            thread.start()
            stack.wait_until(lambda: not thread.is_alive(), "rollouts", 600.0)

        play(batch(6, 0))
        strokes = batch(episodes, 1)
        # On the way to the ready pose time passes, too; it is not counted as played.
        before, ticks = {name: node.cpu_seconds() for name, node in nodes.items()}, ticks_so_far(stack)
        rate = timed("over topics in lockstep", len(strokes.strokes), lambda: play(strokes))
        used = {name: node.cpu_seconds() - before[name] for name, node in nodes.items()}
        passed = ticks_so_far(stack) - ticks
        return Topics(rate, {name: 1e3 * seconds / passed for name, seconds in used.items()})


def ticks_so_far(stack: Stack) -> int:
    """What the simulator says next of how many ticks it has published."""
    stack.diagnostics.pop("simulator", None)
    return int(stack.wait_until(lambda: stack.diagnostics.get("simulator"), "diagnostics")["ticks"])


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=48, help="in Bullet and over topics")
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2], help="processes, and threads")
    words = parser.parse_args()
    print(f"load of the machine at the start: {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    topics = over_topics(words.episodes)
    for rate in (*in_bullet(words.workers, words.episodes), *batched(words.workers), topics.rate):
        print(f"{rate.what:42s} {rate.episodes:9.1f} episodes a second {rate.real_time:9.0f} x real time")
    for name, tick_ms in topics.tick_ms.items():
        print(f"{name:42s} {tick_ms:9.3f} ms of the processor a tick")
    return 0


if __name__ == "__main__":
    sys.exit(main())
