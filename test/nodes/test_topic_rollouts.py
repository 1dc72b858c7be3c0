"""Rollouts over topics and rollouts of Bullet workers: the same trajectories from the same seeds."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.cluster.processes import Processes
from msrd_ros.contract.episode import ACTING_STEPS, Episode
from msrd_ros.contract.outcome import Outcome
from msrd_ros.nodes.topic_rollouts import TopicCollector
from msrd_ros.table_tennis.simulation.world import WorldConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.rollouts import BulletPlayers, StrokeBatch
from processes import RunningProcess
from stack import Stack

pytestmark = pytest.mark.processes

SEED = 6
READY_NOISE_RAD = 0.03
LABELS = (ALL_LABELS[1], ALL_LABELS[3])
EPISODES = 2


@pytest.fixture(scope="module")
def executor(shared_stack: Stack) -> RunningProcess:
    shared_stack.start_simulator(seed=SEED, show=False)
    return shared_stack.start("executor")


@pytest.fixture(scope="module")
def over_topics(shared_stack: Stack, executor: RunningProcess) -> TopicCollector:
    return TopicCollector(shared_stack.node, made_up_policies, "standard", READY_NOISE_RAD, 60.0)


@pytest.fixture(scope="module")
def workers() -> Iterator[BulletPlayers]:
    with Processes(2) as processes:
        yield BulletPlayers(processes, WorldConfig(seed=SEED))


def play(stack: Stack, collector: TopicCollector, batch: StrokeBatch) -> list[tuple[Episode, Outcome]]:
    """Play on a thread, as the trainer does, while this one spins."""
    found: dict[str, Any] = {}

    def work() -> None:
        try:
            found["played"] = collector.play(batch)
        except Exception as error:
            found["error"] = error

    thread = threading.Thread(target=work)
    thread.start()
    stack.wait_until(lambda: not thread.is_alive(), "rollouts", 120.0)
    if "error" in found:
        raise found["error"]
    return found["played"]  # type: ignore[no-any-return]


def drawn(policies: StrokePolicies, seed: int, balls_before: int) -> StrokeBatch:
    rng = np.random.default_rng(seed)
    return StrokeBatch.draw(policies, EPISODES, "standard", READY_NOISE_RAD, balls_before, rng)


def test_workers_and_topics_give_the_same_arrays(
    shared_stack: Stack, over_topics: TopicCollector, workers: BulletPlayers
) -> None:
    """Two batches, of the same policies with other draws, as two iterations might play them."""
    policies = made_up_policies(LABELS, log_std=-2.0)
    batches = [drawn(policies, seed, seed * len(LABELS) * EPISODES) for seed in range(2)]
    starts = []
    for batch in batches:
        played = {
            "topics": play(shared_stack, over_topics, batch),
            "workers": workers.play(batch),
        }
        for (episode, outcome), (again, same) in zip(played["topics"], played["workers"], strict=True):
            assert episode.label == again.label
            np.testing.assert_array_equal(episode.observations, again.observations)
            np.testing.assert_array_equal(episode.joint_velocity, again.joint_velocity)
            # Each worker counts its own balls.
            assert replace(outcome, ball_id=0).to_values() == replace(same, ball_id=0).to_values()
            starts.append(episode.joint_position[0])
    # Every stroke had a start posture of its own.
    assert len(np.unique(starts, axis=0)) == len(starts)


def test_wild_policies_over_topics_keep_every_limit(
    shared_stack: Stack, over_topics: TopicCollector, executor: RunningProcess
) -> None:
    """Outputs of noise, of 1e30, and beyond all numbers, played by the executor on the simulator."""
    calm = made_up_policies(LABELS[:1])
    tensors = calm.policies.tensors
    wild = {
        "noise": {"log_std": np.full_like(tensors["log_std"], 3.0)},
        "huge": {"log_std": np.full_like(tensors["log_std"], 70.0)},
        "overflowing": {"weight/1": np.full_like(tensors["weight/1"], 3e38) * np.sign(tensors["weight/1"])},
    }
    before = int(shared_stack.diagnosed("executor")["stops"])
    for number, changed in enumerate(wild.values()):
        policies = replace(calm, policies=replace(calm.policies, tensors={**tensors, **changed}))
        batch = drawn(policies, number, 0)
        for episode, _ in play(shared_stack, over_topics, batch):
            assert np.isfinite(episode.observations).all()
            acting = episode.joint_velocity[: ACTING_STEPS + 2]
            if "log_std" in changed:
                assert np.abs(acting).max() > 1.0
    figures = shared_stack.diagnosed("simulator")
    assert figures["limits_exceeded"] == "0"
    assert float(figures["speed_fraction_max"]) > 0.5
    assert int(shared_stack.diagnosed("executor")["stops"]) >= before
    executor.require_running()
