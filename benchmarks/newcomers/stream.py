"""A hundred teachers in a row."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import msrd_ros.learning as msrd
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.newcomers import Newcomers
from msrd_ros.learning.policy import Policy
from msrd_ros.studies.inverted_pendulum.demonstrators import Demonstrators, Kind, cached_demonstrators
from msrd_ros.studies.inverted_pendulum.environment import has_fallen
from msrd_ros.studies.inverted_pendulum.presets import inverted_pendulum
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from newcomers.pendulum import chosen

FIRST_STRATEGIES = 5
STREAM_TEACHERS = 100


def stream(seeds: int, _: Path) -> Iterator[dict[str, Any]]:
    """Teachers in a row: half of them are one of the 20, half play a mixture of two of those."""
    demonstrators = cached_demonstrators(Kind.DIAYN)
    teachers = policies_of(demonstrators)
    for seed in range(seeds):
        rng = np.random.default_rng((34, seed))
        known = sorted(rng.permutation(len(teachers))[:FIRST_STRATEGIES].tolist())
        demonstrations = chosen(demonstrators.demonstrate(10, 35_000 + seed), known)
        config = inverted_pendulum()
        learned = msrd.train(demonstrations, PendulumCollector(), config=config, seed=seed, progress=False)
        newcomers = Newcomers(learned, demonstrations, PendulumCollector(), config, seed=seed)
        seconds: list[float] = []
        counts: list[int] = []
        verdicts: Counter[str] = Counter()
        falls: list[float] = []
        for _teacher in range(STREAM_TEACHERS):
            first, second = rng.permutation(len(teachers))[:2]
            share = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.25, 0.75))
            teacher = MixedPolicy([(1.0 - share, teachers[first]), (share, teachers[second])], noise=1.0)
            take = PendulumCollector().collect(teacher, 1, rng)  # type: ignore[arg-type]
            begin = time.perf_counter()
            met = newcomers.meet([take.observations[0, 0]], [take.actions[0, 0]])
            seconds.append(time.perf_counter() - begin)
            counts.append(len(newcomers.learned.labels))
            verdicts[met.recognition.verdict.value] += 1
            alone = MixedPolicy([(1.0, newcomers.policies.policy(met.name))])
            again = PendulumCollector().collect(alone, 2, rng)  # type: ignore[arg-type]
            falls.append(float(has_fallen(again.observations).mean()))
        quarters = [len(counts) // 4 * part - 1 for part in (1, 2, 3, 4)]
        yield {
            "seed": seed,
            "strategies_after_25_50_75_100": [counts[place] for place in quarters],
            "verdicts": dict(verdicts),
            "seconds_first_and_last_quarter": [
                round(float(np.mean(seconds[:25])), 2),
                round(float(np.mean(seconds[-25:])), 2),
            ],
            "seconds_worst": round(max(seconds), 2),
            "falls": float(np.mean(falls)),
        }


def policies_of(demonstrators: Demonstrators) -> list[Policy]:
    """The demonstrators' policies one by one."""
    found = demonstrators.policies
    features = found.features
    return [
        Policy(
            label,
            tuple(weight.detach().numpy()[row] for weight in found.network.weights),
            tuple(bias.detach().numpy()[row, 0] for bias in found.network.biases),
            found.log_std.detach().numpy()[row, 0],
            features.indices.numpy(),
            features.offset.numpy(),
            features.scale.numpy(),
        )
        for row, label in enumerate(demonstrators.labels)
    ]
