"""Lockstep over topics: from a seed simulator and executor, two processes, repeat a rally bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.contract.episode import HORIZON
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feeder
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from stack import Stack
from table_side import SeenTick, TableSide

pytestmark = pytest.mark.processes

LABELS = (ALL_LABELS[0], ALL_LABELS[5])
FEEDS = [Feeder().sample(label.side, STANDARD, np.random.default_rng(1)) for label in LABELS]


def wait_for_strategy(stack: Stack, label: str) -> None:
    stack.wait_until(lambda: stack.diagnostics.get("executor", {}).get("strategy") == label, "strategy")


def play(stack: Stack, side: TableSide, checkpoint: Path) -> list[tuple[list[SeenTick], dict[str, str]]]:
    """Two balls through a fresh simulator and a fresh executor."""
    simulator = stack.start_simulator(seed=4)
    executor = stack.start("executor", checkpoint=checkpoint, ready_noise_rad=0.03, seed=9)
    rallies = []
    for label, feed in zip(LABELS, FEEDS, strict=True):
        stack.wait_until(side.strategy.get_subscription_count, "executor", process=executor)
        side.ask(label)
        wait_for_strategy(stack, str(label))
        stack.wait_until(side.feed.get_subscription_count, "simulator", process=simulator)
        side.clear()
        side.throw(feed)
        stack.wait_until(lambda: side.rally_over, "outcome", 60.0, simulator)
        rallies.append((side.rally_ticks(), side.outcomes[0][1].to_values()))
    assert executor.stop() == simulator.stop() == 0
    stack.wait_until(lambda: not stack.node.count_publishers("joint_states"), "end of the simulator")
    stack.diagnostics.clear()
    side.clear()
    return rallies


def test_fresh_processes_repeat_rallies_bit_for_bit(stack: Stack, tmp_path: Path) -> None:
    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(made_up_policies(LABELS).to_bytes())
    side = TableSide(stack.node, answers=False)
    first, second = (play(stack, side, checkpoint) for _ in range(2))
    for (ticks, outcome), (ticks_again, outcome_again) in zip(first, second, strict=True):
        assert outcome == outcome_again
        assert len(ticks) == len(ticks_again) > HORIZON
        for tick, again in zip(ticks, ticks_again, strict=True):
            assert tick.time_ns - ticks[0].time_ns == again.time_ns - ticks_again[0].time_ns
            np.testing.assert_array_equal(tick.joints, again.joints)
            np.testing.assert_array_equal(tick.ball, again.ball)
    moved = np.ptp([tick.joints[0] for tick in first[0][0]], axis=0)
    assert moved.max() > 0.05
