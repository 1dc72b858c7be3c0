"""The four managed nodes: what each does while it is inactive, and how it goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import Odometry
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.utilities import try_shutdown
from std_srvs.srv import Trigger

from live_executor import LiveExecutor, flying, live_executor, require_safe
from made_up_policies import made_up_policies
from msrd_ros.bags.strokes import Arrival
from msrd_ros.nodes.executor import Executor
from msrd_ros.nodes.managed import ManagedNode
from msrd_ros.nodes.recorder import Recorder
from msrd_ros.nodes.simulator import COMPILES, Simulator
from msrd_ros.nodes.trainer import Trainer
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.stack.processes import ros_arguments
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from synthetic_strokes import stroke_messages

LABEL = ALL_LABELS[0]
POLICIES = made_up_policies((LABEL,), gain=1.0)
DONE = TransitionCallbackReturn.SUCCESS
PATIENCE_S = 120.0

Managed = TypeVar("Managed", bound=ManagedNode)


@contextmanager
def started(make: Callable[[], Managed], domain_id: int, **parameters: object) -> Iterator[Managed]:
    """A node in the test's own process."""
    rclpy.init(args=ros_arguments(parameters), domain_id=domain_id)
    node = make()
    try:
        yield node
    finally:
        node.close()
        node.destroy_node()  # type: ignore[no-untyped-call]
        try_shutdown()


def complaints(node: Any) -> list[str]:
    """What a node complains of from now on."""
    said: list[str] = []
    node.complain = lambda error: said.append(str(error))
    return said


def wait_until(condition: Callable[[], Any]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


@pytest.mark.parametrize("make", [Executor, Recorder, Simulator, Trainer])
def test_round_and_round_nothing_is_left_behind(
    make: Callable[[], ManagedNode], domain_id: int, tmp_path: Path
) -> None:
    own: dict[Any, dict[str, object]] = {
        Recorder: {"directory": tmp_path},
        Trainer: {"out": tmp_path, "source": "played"},
    }
    with started(make, domain_id, autostart=False, **own.get(make, {})) as node:

        def counts() -> list[int]:
            kinds = node.timers, node.subscriptions, node.services, node.clients, node.guards, node.publishers
            return [*(len(list(kind)) for kind in kinds), sum(name != COMPILES for name in threads())]

        def threads() -> list[str]:
            return [thread.name for thread in threading.enumerate()]

        before, inside = counts(), set()
        for _ in range(20):
            assert node.trigger_configure() is DONE
            node.publish_diagnostics()
            assert node.trigger_activate() is DONE
            node.publish_diagnostics()
            inside.add(tuple(counts()))
            assert node.trigger_deactivate() is DONE
            assert node.trigger_cleanup() is DONE
            node.publish_diagnostics()
            assert counts() == before
            assert COMPILES not in threads()
        assert len(inside) == 1
        assert node.trigger_shutdown() is DONE
        node.publish_diagnostics()


def strokes(arm: LiveExecutor) -> int:
    """How many strokes have begun."""
    assert arm.node._player is not None
    return arm.node._player.strokes_begun


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_deactivated_in_mid_stroke_the_arm_brakes_and_plays_on_later(domain_id: int, mode: str) -> None:
    with live_executor(domain_id, mode=mode) as arm:
        arm.policies(POLICIES.to_bytes())
        arm.make_ready(LABEL)
        arm.swing()
        assert arm.node.trigger_deactivate() is DONE
        for step in range(20, 50):
            arm.tick(flying(step))
        assert not arm.moves
        require_safe(arm.commands)
        sent, held = len(arm.commands), arm.commands[-1].points[0].positions
        for step in range(20):
            arm.tick(flying(step))
        # Every tick is answered with the held position; in real time it was said once.
        assert len(arm.commands) - sent == (20 if mode == "lockstep" else 0)
        assert all(command.points[0].positions == held for command in arm.commands[sent:])
        assert strokes(arm) == 1
        assert arm.node.account()[0].startswith("inactive, ")

        assert arm.node.trigger_activate() is DONE
        arm.make_ready(LABEL)
        arm.swing()
        assert strokes(arm) == 2
        require_safe(arm.commands, pauses=mode == "real_time")


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_an_executor_that_was_never_active_holds_in_lockstep_and_is_silent_in_real_time(
    domain_id: int, mode: str
) -> None:
    with live_executor(domain_id, mode=mode, autostart=False) as arm:
        arm.policies(POLICIES.to_bytes())
        arm.strategy(LABEL)
        start = arm.position.copy()
        for step in range(30):
            arm.tick(flying(step))
        assert len(arm.commands) == (30 if mode == "lockstep" else 0)
        assert all(list(command.points[0].positions) == list(start) for command in arm.commands)
        # Led by hand meanwhile; where commands begin is where it is.
        if mode == "real_time":
            arm.position = start + 0.3
            for _ in range(10):
                arm.tick()
        led = arm.position.copy()
        assert arm.node.trigger_activate() is DONE
        arm.tick()
        assert np.abs(np.array(arm.commands[-1].points[0].positions) - led).max() < 0.02
        arm.make_ready(LABEL)
        require_safe(arm.commands)


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
@pytest.mark.parametrize("end", ["cleanup", "shutdown"])
def test_unconfigured_and_finalized_nothing_is_sent_and_the_last_command_ends_at_rest(
    domain_id: int, mode: str, end: str
) -> None:
    with live_executor(domain_id, mode=mode) as arm:
        arm.policies(POLICIES.to_bytes())
        arm.make_ready(LABEL)
        arm.swing()
        if end == "cleanup":
            assert arm.node.trigger_deactivate() is DONE
            assert arm.node.trigger_cleanup() is DONE
        else:
            assert arm.node.trigger_shutdown() is DONE
        assert "joint_command" not in "".join(publisher.topic_name for publisher in arm.node.publishers)
        assert not any("joint_states" in item.topic_name for item in arm.node.subscriptions)
        assert not np.any(arm.commands[-1].points[-1].velocities)
        require_safe(arm.commands)


def test_of_an_inactive_simulator_time_stands_and_feeds_are_refused(domain_id: int) -> None:
    with started(Simulator, domain_id, autostart=False, show=False) as node:
        assert node.trigger_configure() is DONE
        ticks: list[int] = []
        node._output.publish_tick = lambda show: ticks.append(node._world.time_ns)  # type: ignore[method-assign]
        said = complaints(node)

        def look() -> int:
            """How often a tick is told when it is due again."""
            before = len(ticks)
            node._asked_s = -1e9
            node._ask_again()
            return len(ticks) - before

        assert look() == 0
        node._on_feed(Odometry())
        assert said == [
            "simulator is inactive; call /simulator/change_state (ros2 lifecycle set /simulator activate)"
        ]
        for service in (node._on_serve, node._on_reset):
            assert service(Trigger.Request(), Trigger.Response()).message == said[0]
        assert node._world.feeds_waiting == 0
        assert node.trigger_activate() is DONE
        assert look() == 1
        assert node._on_serve(Trigger.Request(), Trigger.Response()).success
        assert node.trigger_deactivate() is DONE
        assert look() == 0
        assert node.trigger_activate() is DONE
        # What was fed before still waits, and the tick that was under way is asked again.
        assert node._world.feeds_waiting == 1
        assert look() == 1
        assert ticks[-1] == ticks[0]


def test_deactivated_the_recorder_has_written_what_was_decided_and_takes_no_more(
    domain_id: int, tmp_path: Path
) -> None:
    with started(Recorder, domain_id, directory=tmp_path) as node:
        verdicts: list[dict[str, str]] = []
        node._verdict.publish = lambda message: verdicts.append(  # type: ignore[assignment, method-assign]
            {pair.key: pair.value for pair in message.status[0].values}  # type: ignore[union-attr]
        )

        def record(ball: int, decided: bool = True) -> None:
            begin = 2_000_000_000 + ball * 3_000_000_000
            messages = stroke_messages(start_ns=begin, ball_id=ball)
            for number, message in enumerate(messages if decided else messages[:-1]):
                now_ns = message.log_time_ns
                node._take(Arrival(message.topic, message.data, now_ns, now_ns, number))

        record(1)
        assert node.diagnose()[1]["decided"]
        assert node.trigger_deactivate() is DONE
        assert len(BagLibrary.scan(tmp_path).bags) == 1
        assert [verdict["kept"] for verdict in verdicts] == ["true"]
        refused = node._on_start(Trigger.Request(), Trigger.Response())
        assert not refused.success
        assert "recorder is inactive; call /recorder/change_state" in refused.message
        record(2)
        while node._buffer.pending:
            node._cut()
        node._report_results()
        assert verdicts[-1]["kept"] == "false"
        assert "inactive" in verdicts[-1]["detail"]

        assert node.trigger_activate() is DONE
        record(3)
        record(4, decided=False)
        assert node.trigger_deactivate() is DONE
        assert len(BagLibrary.scan(tmp_path).bags) == 2
        assert not node.diagnose()[1]["stroke_under_way"]


def test_training_waits_goes_on_is_freed_and_resumed(domain_id: int, tmp_path: Path) -> None:
    tiny = {
        "labels": [str(ALL_LABELS[0])],
        "subjects": ["subject_01"],
        "episodes": 4,
        "evaluate_every": 0,
        "workers": 1,
        "iterations": 100_000,
        "checkpoint_every": 0,
    }

    def training() -> bool:
        return any(thread.name == "training" for thread in threading.enumerate())

    with started(Trainer, domain_id, autostart=False, out=tmp_path, **tiny) as node:
        assert node.trigger_configure() is DONE
        assert not training()
        assert not node._on_start(Trigger.Request(), Trigger.Response()).success
        assert node.trigger_activate() is DONE
        assert node._run is not None
        harness, checkpoint = node._run.harness, tmp_path / "checkpoint.safetensors"
        wait_until(lambda: harness.iteration > 1)
        assert not checkpoint.exists()
        assert node.trigger_deactivate() is DONE
        wait_until(lambda: not harness.checkpoint_wanted.is_set() and checkpoint.exists())
        done = harness.iteration
        checkpoint.unlink()
        # A checkpoint may be asked for meanwhile.
        assert node._on_checkpoint(Trigger.Request(), Trigger.Response()).success
        wait_until(checkpoint.exists)
        assert harness.iteration == done
        assert training()
        assert node.trigger_activate() is DONE
        wait_until(lambda: harness.iteration > done)
        assert node.trigger_deactivate() is DONE
        assert node.trigger_cleanup() is DONE
        assert not training()
        done = harness.iteration

        # Configured again it reads its bags anew and goes on with its own run.
        assert node.trigger_configure() is DONE
        assert node.trigger_activate() is DONE
        assert node._run is not None
        harness = node._run.harness
        wait_until(lambda: harness.iteration > done)
        assert node.trigger_shutdown() is DONE
        assert not training()
