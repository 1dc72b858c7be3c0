"""Teachers of the inverted pendulum: what they leave as it is, and what they get."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import msrd_ros.learning as msrd
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.newcomers import Newcomers
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.inverted_pendulum.demonstrators import Demonstrators, Kind, cached_demonstrators
from msrd_ros.studies.inverted_pendulum.environment import has_fallen
from msrd_ros.studies.inverted_pendulum.presets import inverted_pendulum
from msrd_ros.studies.inverted_pendulum.rollouts import PendulumCollector
from msrd_ros.studies.inverted_pendulum.study import PENDULUM
from msrd_ros.studies.shared.evaluation import (
    TestSet,
    correlation,
    make_test_set,
    table_over,
    task_correlation,
)

KNOWN_STRATEGIES = 16


def chosen(demonstrations: Demonstrations, rows: list[int]) -> Demonstrations:
    """Some of the strategies."""
    labels = tuple(demonstrations.layout.labels[row] for row in rows)
    return Demonstrations(
        demonstrations.observations[rows],
        demonstrations.actions[rows],
        replace(demonstrations.layout, labels=labels),
    )


def marks(learned: msrd.Learned, test: TestSet, demonstrators: Demonstrators) -> dict[str, Any]:
    """Task r, and by strategy r and whether its reward is highest on its own trajectories, of all 20."""

    def table(states: torch.Tensor) -> torch.Tensor:
        return torch.as_tensor(
            np.stack([learned.strategy_reward(name, states.numpy()) for name in learned.labels])
        )

    rows = [demonstrators.labels.index(name) for name in learned.labels]
    clean = table_over(table, test.clean)
    flat = clean.reshape(len(rows), -1)
    return {
        "task_r": task_correlation(lambda states: torch.as_tensor(learned.task_reward(states.numpy())), test),
        "strategy_r": [correlation(flat[i], test.clean_truth[row]) for i, row in enumerate(rows)],
        "own_highest": [bool(clean[i].mean(axis=1).argmax() == row) for i, row in enumerate(rows)],
    }


def pendulum(seeds: int, _: Path) -> Iterator[dict[str, Any]]:
    """Learn 16 strategies, then meet the other four."""
    demonstrators = cached_demonstrators(Kind.DIAYN)
    for seed in range(seeds):
        everything = demonstrators.demonstrate(20, 31_000 + seed)
        order = np.random.default_rng((31, seed)).permutation(len(demonstrators.labels)).tolist()
        known, others = sorted(order[:KNOWN_STRATEGIES]), order[KNOWN_STRATEGIES:]
        demonstrations = chosen(everything, known)
        config = inverted_pendulum()
        learned = msrd.train(demonstrations, PendulumCollector(), config=config, seed=seed, progress=False)
        test = make_test_set(PENDULUM, demonstrators, 32_000 + seed)
        before = marks(learned, test, demonstrators)
        newcomers = Newcomers(learned, demonstrations, PendulumCollector(), config, seed=seed)
        fresh = demonstrators.demonstrate(2, 33_000 + seed)
        recognised = [
            newcomers.recognise([fresh.observations[row, 1]]).verdict.value == "known" for row in known
        ]
        verdicts, seconds, falls = [], [], []
        for row in others:
            begin = time.perf_counter()
            met = newcomers.meet(
                [fresh.observations[row, 0]], [fresh.actions[row, 0]], demonstrators.labels[row]
            )
            seconds.append(time.perf_counter() - begin)
            verdicts.append(met.recognition.verdict.value)
            alone = MixedPolicy([(1.0, newcomers.policies.policy(met.name))])
            rollouts = PendulumCollector().collect(alone, 20, np.random.default_rng(seed))  # type: ignore[arg-type]
            falls.append(float(has_fallen(rollouts.observations).mean()))
        after = marks(newcomers.learned, test, demonstrators)
        count = len(known)
        yield {
            "seed": seed,
            "task_r_before": round(before["task_r"], 4),
            "task_r_after": round(after["task_r"], 4),
            "strategy_r_before": round(float(np.mean(before["strategy_r"])), 4),
            "strategy_r_after": round(float(np.mean(after["strategy_r"][:count])), 4),
            "own_highest_before": sum(before["own_highest"]),
            "own_highest_after": sum(after["own_highest"][:count]),
            "known_taken_for_known": float(np.mean(recognised)),
            "newcomers_taken_for_new": verdicts.count("new") / len(verdicts),
            "newcomers_strategy_r": [round(value, 3) for value in after["strategy_r"][count:]],
            "newcomers_own_highest": sum(after["own_highest"][count:]),
            "newcomers_falls": float(np.mean(falls)),
            "seconds": round(float(np.mean(seconds)), 1),
        }
