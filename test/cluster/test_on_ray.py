"""Units on Ray: bit-identical to this machine's processes, also when a process and a machine are lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ray
from ray.cluster_utils import Cluster

import learning_units
import units
from made_up_policies import made_up_policies
from msrd_ros.cluster.on_ray import ADDRESS_VARIABLE, RayWorkers
from msrd_ros.cluster.places import Place
from msrd_ros.cluster.processes import Processes
from msrd_ros.cluster.unit import Unit
from msrd_ros.cluster.workers import UnitsError, Workers
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.simulation.world import WorldConfig
from msrd_ros.table_tennis.strokes.rollouts import BulletPlayers, StrokeBatch
from processes import CHECKOUT

pytestmark = [pytest.mark.processes, pytest.mark.slow]

HELPERS = CHECKOUT / "test" / "helpers"
LOOPBACK = "127.0.0.1"
LOST, KILLED = 1, 3
"""Units whose machine, and whose process, is ended while they are under way."""
QUICKLY_NOTICED = {
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 500,
    "health_check_failure_threshold": 4,
}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """Three machines, as far as Ray knows: one that only directs, and two with a processor each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{CHECKOUT}{os.pathsep}{HELPERS}")
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        head = {
            "num_cpus": 0,
            "node_ip_address": LOOPBACK,
            "include_dashboard": False,
            "_system_config": QUICKLY_NOTICED,
        }
        started = Cluster(initialize_head=True, head_node_args=head)
        for _ in range(2):
            started.add_node(num_cpus=1, node_ip_address=LOOPBACK)
        yield started
        started.shutdown()


def node_of(cluster: Cluster, name: str) -> Any:
    return next(node for node in cluster.worker_nodes if node.node_id == name)


def end_when_marked(cluster: Cluster, marks: Path) -> threading.Thread:
    """Kill the process of one unit, and take away the machine of another one, once each has begun."""

    def work() -> None:
        for number in (LOST, KILLED):
            mark = marks / str(number)
            while not mark.exists():
                time.sleep(0.05)
            process, node = mark.read_text().split()
            if number == KILLED:
                os.kill(int(process), signal.SIGKILL)
            else:
                cluster.remove_node(node_of(cluster, node), allow_graceful=False)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def learned(workers: Workers, marks: Path, waiting: tuple[int, ...]) -> tuple[dict[str, Any], list[str]]:
    results: dict[str, Any] = {}
    told: list[str] = []
    workers.run(
        learning_units.learn,
        [Unit(f"run {number}", (number,)) for number in range(5)],
        lambda unit, result: results.__setitem__(unit.name, result),
        (str(marks), waiting),
        told.append,
    )
    return results, told


def test_a_lost_process_and_a_lost_machine_change_no_bit(cluster: Cluster, tmp_path: Path) -> None:
    with Processes(2) as workers:
        expected, _ = learned(workers, tmp_path, ())
    handler = signal.getsignal(signal.SIGTERM)
    with RayWorkers(cluster.address, 0) as workers:
        assert workers.slots() == 2
        ender = end_when_marked(cluster, tmp_path)
        found, told = learned(workers, tmp_path, (LOST, KILLED))
        ender.join(10.0)
        assert signal.getsignal(signal.SIGTERM) is handler
    again = [line for line in told if "tried again (1 of 3)" in line]
    assert [line.partition(":")[0] for line in again if "lost" in line][-1] == f"run {KILLED}"
    assert any(line.startswith(f"run {LOST}:") for line in again)
    assert len(cluster.worker_nodes) == 1
    assert sorted(found) == [f"run {number}" for number in range(5)]
    assert found == expected


def test_bullet_plays_the_same_strokes_on_ray(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the address of the environment, as the trainer's `rollouts:=ray` asks for it."""
    batch = StrokeBatch.draw(made_up_policies(log_std=-2.0), 3, "standard", 0.03, 5, np.random.default_rng(0))
    monkeypatch.setenv(ADDRESS_VARIABLE, cluster.address)
    played = []
    for place in (Place.parse("ray", "--on"), Place.parse("local", "--on")):
        with place.open(1) as workers:
            played.append(BulletPlayers(workers, WorldConfig(seed=4)).play(batch))
    assert len(played[0]) == len(batch.strokes) > 12
    for (episode, outcome), (same, alike) in zip(*played, strict=True):
        assert np.array_equal(episode.observations, same.observations)
        assert np.array_equal(episode.actions, same.actions)
        assert repr(outcome) == repr(alike)


def test_a_unit_that_fails_on_ray_takes_none_along(cluster: Cluster) -> None:
    results: dict[str, Any] = {}
    with RayWorkers(cluster.address, 0) as workers, pytest.raises(UnitsError, match="too much") as caught:
        workers.run(
            units.fail_at_two,
            [Unit(f"unit {number}", (number,)) for number in range(4)],
            lambda unit, result: results.__setitem__(unit.name, result),
            ValueError,
        )
    assert "raise shared" in str(caught.value)
    assert sorted(results) == ["unit 0", "unit 1", "unit 3"]


def test_a_ray_of_our_own_is_on_loopback_and_leaves_nothing_behind(tmp_path: Path) -> None:
    code = """
import signal, subprocess, units
from msrd_ros.cluster.places import Place
before = signal.getsignal(signal.SIGTERM)
with Place.parse("ray", "--on").open(2) as workers:
    print(workers.map(units.square, [(number,) for number in range(4)], 3))
    import ray
    print(ray._private.worker._global_node.get_session_dir_path())
    print({node["NodeManagerAddress"] for node in ray.nodes()})
assert signal.getsignal(signal.SIGTERM) is before
"""
    environment = {**os.environ, "PYTHONPATH": f"{CHECKOUT}{os.pathsep}{HELPERS}"}
    environment.pop(ADDRESS_VARIABLE, None)
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    results, session, addresses = done.stdout.splitlines()[-3:]
    assert results == "[0, 3, 12, 27]"
    assert addresses == str({LOOPBACK})
    deadline_s = time.monotonic() + 10.0
    while (left := processes_of(session)) and time.monotonic() < deadline_s:
        time.sleep(0.2)
    assert left == []


def processes_of(session: str) -> list[str]:
    """Command lines that name a session of Ray."""
    found = []
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = place.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if session in line:
            found.append(line)
    return found


@pytest.mark.parametrize("scheme", ["", "ray://"])
def test_nobody_at_an_address_is_one_clear_line(scheme: str) -> None:
    with pytest.raises(UserError, match=r"no Ray at .*127\.0\.0\.1:1: .*refused"):
        RayWorkers(f"{scheme}{LOOPBACK}:1", 0)
    assert not ray.is_initialized()
