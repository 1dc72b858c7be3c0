"""Teachers that come after training: what they are taken for, how they are played, what becomes of the rest.

Run from the repository: ``python benchmarks/new_teachers.py [--only NAME ...] [--seeds 5]``. Prints one line
of JSON for each case, and last the means of each part:

* ``strokes``: teachers between push and slice, between slice and topspin, and one who lobs, of a population
  that nothing was tuned on, come to a trainer's run on the bags that ship (``python -m msrd_ros trainer
  --ros-args -p out:=out/new_teachers -p corrective_cloning:=true``); recorded and played in Bullet in this
  process, as over the topics.
* ``pendulum``: MSRD learns 16 of the 20 DIAYN strategies and meets the others, from one demonstration each;
  task r and strategy r by the truth, before and after, by the study's own measure.
* ``stream``: 100 teachers in a row come to 5 of them: each of the 20 or a mixture of two, by chance.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

import msrd_ros.learning as msrd
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS, EpisodeAssembler
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.harness import CHECKPOINT_FILE
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.newcomers import Newcomers
from msrd_ros.learning.policy import Policy
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.recordings.demonstrations import load_strokes
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
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, STANDARD, Feeder
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.paper import Stroke
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.newcomers import StrokeNewcomers
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.rollouts import Stroke as PlayedStroke
from msrd_ros.table_tennis.strokes.rollouts import play_stroke
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE
from msrd_ros.table_tennis.teachers.guided_stroke import GuidedStroke
from msrd_ros.table_tennis.teachers.individual import IndividualTeacher, OwnStroke

TICK_S = 0.004
AFTER_OUTCOME_S = 0.4
POPULATION = 1000
"""Seeds of the teachers here begin above those that anything was tried on."""
TEACHERS = {
    "between-push-and-slice": OwnStroke.between(Side.FOREHAND, Stroke.PUSH, Stroke.SLICE, 0.5),
    "between-slice-and-topspin": OwnStroke.between(Side.FOREHAND, Stroke.SLICE, Stroke.TOPSPIN, 0.7),
    "lob": OwnStroke.lob(Side.FOREHAND),
}
KNOWN_STRATEGIES = 16
FIRST_STRATEGIES = 5
STREAM_TEACHERS = 100

# -- strokes -----------------------------------------------------------------------------------------


def recorded(
    world: World, stroke: GuidedStroke, rng: np.random.Generator, side: Side, label: StrategyLabel, who: str
) -> tuple[Episode, Outcome]:
    """Lead a stroke by the hand in a world of this process, as a demonstrator does over the topics."""
    robot = world.config.rally.robot
    world.set_teaching(False)
    world.rally.reset(stroke.ready_posture)
    world.set_teaching(True)
    world.strategy = label
    assembler = EpisodeAssembler(label, who, f"{label} by {who}", robot)
    world.feed(Feeder().sample(side, STANDARD, rng))
    outcome, until_ns = None, None
    while until_ns is None or world.time_ns < until_ns:
        tick = world.tick()
        assembler.add_joints(tick.time_ns, tick.joint_position, tick.joint_velocity)
        assembler.add_ball(tick.ball_stamp_ns, tick.ball_position)
        stroke.see(tick.ball_stamp_ns / NANOSECONDS, tick.ball_position)
        world.lead_hand(stroke.hand_at(tick.time_ns / NANOSECONDS, tick.joint_position))
        world.advance(TICK_S)
        if world.results:
            outcome = world.results.popleft().outcome
            until_ns = world.time_ns + round(AFTER_OUTCOME_S * NANOSECONDS)
    assert outcome is not None
    return replace(assembler.assemble(), outcome=outcome), outcome


def shown(world: World, name: str, seed: int, count: int) -> list[Episode]:
    """So many strokes of a teacher that returned the ball, as a recorder keeps them."""
    teacher = IndividualTeacher(TEACHERS[name], seed, POPULATION)
    kept: list[Episode] = []
    for attempt in range(10 * count):
        rng = np.random.default_rng((POPULATION, seed, attempt))
        episode, outcome = recorded(
            world, teacher.begin(rng), rng, TEACHERS[name].side, StrategyLabel(name), f"teacher-{seed}"
        )
        if outcome.returned:
            kept.append(episode)
        if len(kept) == count:
            return kept
    raise RuntimeError(f"{name} {seed}: {len(kept)} of {count} strokes were returned")


def spins(outcomes: list[Outcome]) -> NDArray[np.float64]:
    """About y, of those that were returned."""
    return np.array([outcome.spin_y_rad_s for outcome in outcomes if outcome.returned])


def played(
    world: World, policies: StrokePolicies, label: StrategyLabel, balls: int, seed: int
) -> list[Outcome]:
    """What becomes of balls that none was trained on."""
    rng, side = np.random.default_rng((EVALUATION_STREAM, seed)), policies.require(label).side
    world.set_teaching(False)
    outcomes = []
    for number in range(balls):
        stroke = PlayedStroke(label, Feeder().sample(side, STANDARD, rng), number)
        outcomes.append(play_stroke(world, policies, stroke, number, 0.03, seed)[1])
    return outcomes


def strokes(seeds: int, run: Path, balls: int = 50, usual: int = 20) -> Iterator[dict[str, Any]]:
    """Every teacher with one recording and with three; its usual spin is that of its next ones."""
    known = StrokePolicies.load(run / POLICIES_FILE)
    rewards = msrd.Learned.load(run / CHECKPOINT_FILE).rewards
    episodes = load_strokes(shipped_bags())
    world = World(WorldConfig())
    for name in TEACHERS:
        for seed in range(seeds):
            takes = shown(world, name, seed, 3 + usual)
            teachers_spin = float(np.mean(spins([e.outcome for e in takes[3:] if e.outcome])))
            for count in (1, 3):
                begin = time.perf_counter()
                newcomers = StrokeNewcomers(known, rewards, episodes)
                met = newcomers.meet_strokes(takes[:count], StrategyLabel(name))
                seconds = time.perf_counter() - begin
                outcomes = played(world, newcomers.stroke_policies, StrategyLabel(met.name), balls, seed)
                spin = spins(outcomes)
                yield {
                    "teacher": name,
                    "seed": seed,
                    "recordings": count,
                    "verdict": str(met.recognition),
                    "returned": float(np.mean([outcome.returned for outcome in outcomes])),
                    "spin": round(float(spin.mean()), 1),
                    "spin_of_recordings": round(
                        float(np.mean(spins([e.outcome for e in takes[:count] if e.outcome]))), 1
                    ),
                    "spin_of_teacher": round(teachers_spin, 1),
                    "off_teacher": round(abs(float(spin.mean()) - teachers_spin), 1),
                    "episodes": met.episodes,
                    "seconds": round(seconds, 1),
                }
    world.close()


# -- pendulum ----------------------------------------------------------------------------------------


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


# -- a hundred teachers ------------------------------------------------------------------------------


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
        for _ in range(STREAM_TEACHERS):
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


PARTS = {"strokes": strokes, "pendulum": pendulum, "stream": stream}


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
