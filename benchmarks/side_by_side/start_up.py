"""What a node takes of the processor until it answers: right after an installation, and later."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from rcl_interfaces.srv import ListParameters

from processes import Installation, Launcher, RunningProcess
from side_by_side.table import Comparison
from stack import Stack

DOMAIN_ID = 95
NODES: Mapping[str, Mapping[str, object]] = {
    "simulator": {},
    "executor": {},
    "recorder": {},
    "evaluator": {},
    "trainer": {"source": "played"},
    "demonstrator": {},
    "match": {},
    "chooser": {},
}
"""Whose start is measured, with what parameters."""
BARE = "import rclpy; from rclpy.node import Node; rclpy.init(); rclpy.spin(Node('bare'))"
PATIENCE_S = 300.0
NOTE = (
    "seconds of the processor, from the process's start until the node answers a request for its "
    "parameters; beside a node of rclpy alone that does nothing; first: nothing is compiled yet, as "
    "after an installation; later: the median of three"
)


def seconds_until_answer(stack: Stack, process: RunningProcess, name: str) -> float:
    """Wait until a node answers, and end it; seconds of the processor that it has used until then."""
    client = stack.node.create_client(ListParameters, f"/{name}/list_parameters")
    future: Any = None

    def answered() -> bool:
        nonlocal future
        if future is None and client.service_is_ready():
            future = client.call_async(ListParameters.Request())
        return future is not None and bool(future.done())

    stack.wait_until(answered, f"answer of {name}", PATIENCE_S, process)
    took_s = process.cpu_seconds()
    stack.node.destroy_client(client)
    process.stop(timeout_s=PATIENCE_S)  # right after an installation it compiles on
    stack.wait_until(lambda: name not in stack.node.get_node_names(), f"end of {name}")
    return took_s


def compare(starts: int = 3) -> Iterator[Comparison]:
    """Lines of the table."""
    with tempfile.TemporaryDirectory() as folder, Stack(DOMAIN_ID, folder) as stack:
        bare = sorted(_bare(stack, Path(folder)) for _ in range(starts))[starts // 2]
        for name, parameters in NODES.items():
            launcher = Launcher(Installation("checkout", checkout=True), DOMAIN_ID, Path(folder))
            launcher.set("NUMBA_CACHE_DIR", str(Path(folder, "compiled", name)))
            times = []
            with closing(launcher):
                for _ in range(1 + starts):
                    process = launcher.start(name, parameters=dict(parameters))
                    times.append(seconds_until_answer(stack, process, name))
            for when, seconds in (("first", times[0]), ("later", sorted(times[1:])[starts // 2])):
                what = f"start of {name}, {when}"
                yield Comparison(what, "s", seconds, "bare rclpy node", bare, less_is_better=True, note=NOTE)


def _bare(stack: Stack, folder: Path) -> float:
    environment = {**Installation("checkout", checkout=True).environment(), "ROS_DOMAIN_ID": str(DOMAIN_ID)}
    process = RunningProcess("bare", [sys.executable, "-c", BARE], environment, folder)
    return seconds_until_answer(stack, process, "bare")
