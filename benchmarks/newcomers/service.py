"""From the recorder's verdict to an executor that has the policies, with the nodes as processes."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context

from msrd_ros.core.resources import shipped_bags
from msrd_ros.nodes.common import EVENT, status
from msrd_ros.recordings.curation import Curation
from msrd_ros.stack.monitor import Monitor
from msrd_ros.stack.processes import NodeProcess, own_domain

SUBJECT = "subject_03"
BAGS = ("forehand-slice_001", "forehand-topspin_001", "backhand-push_001")
PATIENCE_S = 300.0


def service(seeds: int, run: Path) -> Iterator[dict[str, Any]]:
    """A few shipped strokes under new names; the executor's diagnostics come once a second."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(run, folder / "run")
        environment = own_domain()
        with (
            Monitor(environment) as monitor,
            NodeProcess("simulator", {}, environment, folder / "simulator.log"),
            NodeProcess("executor", {}, environment, folder / "executor.log"),
            NodeProcess(
                "trainer",
                {"out": folder / "run", "resume": True, "corrective_cloning": True, "serve": True},
                environment,
                folder / "trainer.log",
            ) as trainer,
        ):
            context = Context()
            rclpy.init(context=context, args=["recorder"])
            node = rclpy.create_node("recorder", context=context)
            verdicts = node.create_publisher(DiagnosticArray, "recorder/verdict", EVENT)
            try:
                _wait(lambda: monitor.values("trainer").get("taken") == "0", trainer, "the trainer serves")
                _wait(lambda: bool(monitor.values("executor").get("policies")), trainer, "policies")
                for number, bag in enumerate(BAGS):
                    shutil.copytree(shipped_bags() / SUBJECT / bag, folder / "bags" / SUBJECT / bag)
                    Curation(folder / "bags").relabel(folder / "bags" / SUBJECT / bag, f"mine-{number}")
                    before = monitor.values("executor")["policies"]
                    kept = {
                        "ball_id": number,
                        "kept": True,
                        "reason": "",
                        "path": folder / "bags" / SUBJECT / f"mine-{number}_001",
                    }
                    begin = time.monotonic()
                    verdicts.publish(DiagnosticArray(status=[status("stroke", "kept", kept)]))
                    _wait(
                        lambda old=before: monitor.values("executor")["policies"] != old,
                        trainer,
                        "new policies",
                    )
                    yield {"bag": bag, "seconds": round(time.monotonic() - begin, 1)}
            finally:
                node.destroy_node()
                context.try_shutdown()


def _wait(condition: Any, trainer: NodeProcess, what: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if trainer.exit_status is not None or time.monotonic() > deadline:
            raise RuntimeError(f"waited for {what} in vain")
        time.sleep(0.1)
