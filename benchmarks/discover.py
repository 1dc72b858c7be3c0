"""How well strategies are discovered in demonstrations whose labels are hidden, few or wrong.

Run from the repository: ``python benchmarks/discover.py [--only NAME ...] [--seeds 5]``.
Prints one line of JSON for each set of demonstrations and seed, and last the means. Strokes are those of the
bags that the package ships; a seed draws which of them are shown, whose labels are wrong, which episodes the
demonstrators of pendulum and Hopper play, and everything that discovery draws. ``landers`` are the two ways
to land that ship as the quick start's example, ``lander`` FLAIR's ten strategies of three episodes each.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import msrd_ros.learning as msrd
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.recordings.demonstrations import demonstrations as recorded
from msrd_ros.studies.hopper import demonstrators as hopper
from msrd_ros.studies.inverted_pendulum import demonstrators as pendulum
from msrd_ros.studies.lunar_lander.demonstrations import load_demonstrations

EPISODES = 10


class Shown(NamedTuple):
    """Demonstrations, what is said of them, and what is true."""

    observations: list[NDArray[np.float64]]
    actions: list[NDArray[np.float64]]
    labels: list[str | None]
    truth: list[str]


def hidden(demonstrations: Demonstrations) -> Shown:
    """Without labels."""
    seen, done, truth = (list(part) for part in zip(*demonstrations.trajectories(), strict=True))
    return Shown(seen, done, [None] * len(seen), truth)


def few(shown: Shown, each: int, rng: np.random.Generator, strategies: int | None = None) -> Shown:
    """A few demonstrations of each strategy, drawn; of all strategies unless a number of them is given."""
    truth = np.array(shown.truth)
    names = list(dict.fromkeys(shown.truth))
    if strategies is not None:
        names = [str(name) for name in rng.choice(names, strategies, replace=False)]
    kept = [
        int(number)
        for name in names
        for number in rng.choice(np.flatnonzero(truth == name), each, replace=False)
    ]
    return Shown(*([part[number] for number in kept] for part in shown))  # type: ignore[arg-type]


def misled(shown: Shown, share: float, rng: np.random.Generator) -> Shown:
    """With labels, of which a share is another strategy's, drawn."""
    names = list(dict.fromkeys(shown.truth))
    labels: list[str | None] = list(shown.truth)
    for number in rng.choice(len(labels), round(share * len(labels)), replace=False):
        labels[number] = str(rng.choice([name for name in names if name != shown.truth[number]]))
    return shown._replace(labels=labels)


def purity(truth: list[str], found: tuple[str, ...]) -> float:
    """Share of demonstrations that are of the commonest true strategy of their group."""
    return float(counts(truth, found).max(axis=0).sum() / len(truth))


def adjusted_rand_index(truth: list[str], found: tuple[str, ...]) -> float:
    """Share of pairs on which two partitions agree, chance counted as 0 (Hubert and Arabie, 1985)."""
    table = counts(truth, found)

    def pairs(values: Any) -> float:
        return float((values * (values - 1) / 2).sum())

    both, one, other = pairs(table), pairs(table.sum(axis=1)), pairs(table.sum(axis=0))
    chance, most = one * other / pairs(table.sum(keepdims=True)), (one + other) / 2
    return 1.0 if most == chance else (both - chance) / (most - chance)


def counts(truth: list[str], found: tuple[str, ...]) -> NDArray[np.int64]:
    """Demonstrations by true strategy and group."""
    rows, columns = (np.unique(names, return_inverse=True)[1] for names in (truth, found))
    table = np.zeros((rows.max() + 1, columns.max() + 1), dtype=np.int64)
    np.add.at(table, (rows, columns), 1)
    return table


def judge(shown: Shown, seed: int) -> dict[str, Any]:
    """Discover, and hold the result against the truth."""
    begin, begin_cpu = time.perf_counter(), time.process_time()
    found = msrd.discover(shown.observations, shown.actions, shown.labels, seed=seed)
    seconds, cpu_seconds = time.perf_counter() - begin, time.process_time() - begin_cpu
    result: dict[str, Any] = {
        "strategies": len(set(shown.truth)),
        "found": len(found.names),
        "purity": round(purity(shown.truth, found.labels), 3),
        "ari": round(adjusted_rand_index(shown.truth, found.labels), 3),
        "one_policy": found.one_policy,
        "seconds": round(seconds, 1),
        "cpu_seconds": round(cpu_seconds, 1),
    }
    wrong = [
        label is not None and label != true for label, true in zip(shown.labels, shown.truth, strict=True)
    ]
    if any(wrong):
        doubted = np.isin(np.arange(len(wrong)), found.doubted)
        result["wrong_doubted"] = round(float(doubted[wrong].mean()), 3)
        result["right_doubted"] = round(float(doubted[np.logical_not(wrong)].mean()), 3)
    return result


def sets() -> dict[str, Callable[[int], Shown]]:
    """What is discovered in, by name; each takes a seed."""
    strokes = hidden(recorded(shipped_bags()))
    lander = hidden(load_demonstrations().demonstrate(3))
    return {
        "strokes": lambda seed: strokes,
        "strokes, 2 each": lambda seed: few(strokes, 2, np.random.default_rng([seed, 1])),
        "strokes, 3 each": lambda seed: few(strokes, 3, np.random.default_rng([seed, 1])),
        "strokes, 3 each of two": lambda seed: few(strokes, 3, np.random.default_rng([seed, 1]), 2),
        "strokes, 9 of one": lambda seed: few(strokes, 9, np.random.default_rng([seed, 1]), 1),
        "strokes, a third wrong": lambda seed: misled(strokes, 1 / 3, np.random.default_rng([seed, 2])),
        "pendulum": lambda seed: hidden(
            pendulum.cached_demonstrators(pendulum.Kind.DIAYN).demonstrate(EPISODES, seed)
        ),
        "hopper": lambda seed: hidden(gaits(hopper.PAIRS[seed % len(hopper.PAIRS)], seed)),
        "landers": lambda seed: hidden(msrd.example_demonstrations("lunar_lander")),
        "lander": lambda seed: lander,
    }


def gaits(pair: str, seed: int) -> Demonstrations:
    """Episodes of a pair of Hopper's demonstrators, without the column that is the true reward."""
    shown = hopper.cached_demonstrators(pair).demonstrate(EPISODES, seed)
    names = shown.layout.observation_names[1:]
    return msrd.demonstrations_from_arrays(
        [seen[:, 1:] for seen, _, _ in shown.trajectories()],
        [done for _, done, _ in shown.trajectories()],
        [label for _, _, label in shown.trajectories()],
        observation_names=names,
    )


def main() -> None:
    """Print a line for each set and seed, and the means over seeds."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    for name, make in sets().items():
        if arguments.only and name not in arguments.only:
            continue
        results = []
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
            results.append(judge(make(seed), seed))
            print(json.dumps({"set": name, "seed": seed, **results[-1]}), flush=True)
        means = {key: round(float(np.mean([result[key] for result in results])), 3) for key in results[0]}
        exact = sum(result["ari"] == 1.0 for result in results)
        print(json.dumps({"set": name, "seeds": len(results), "exact": exact, "mean": means}), flush=True)


if __name__ == "__main__":
    main()
