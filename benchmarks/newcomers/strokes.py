"""Teachers of strokes, recorded and played in Bullet in this process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import msrd_ros.learning as msrd
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS, EpisodeAssembler
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.harness import CHECKPOINT_FILE
from msrd_ros.recordings.demonstrations import load_strokes
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
